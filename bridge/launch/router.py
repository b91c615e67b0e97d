"""`surefoot router`: a Zenoh router that joins the processes of several machines."""

from __future__ import annotations

import logging
import sys
import time
from contextlib import ExitStack, closing
from typing import Final

from bridge.command_line.options import ConfigOption, SetOption
from bridge.config.load import load_config
from bridge.keys.identity import ROUTER
from bridge.launch.watch import StopSignals
from bridge.transport.links import LinkWatch
from bridge.transport.wire_log import WireLog
from bridge.transport.zenoh import open_session

POLL_S: Final = 0.2


def router(config: ConfigOption = None, set_: SetOption = None) -> None:
    """Hand messages on between the processes of this machine and the routers of others, until Ctrl-C.

    Listens where `bridge.router.listen` says and connects to `bridge.router.connect`. The processes find it
    through `bridge.connect`. With `bridge.keys` it judges by the certificate at each link who may say what.

    Example: surefoot router --set 'bridge.router.connect=["tls/10.0.0.2:7470"]'
    """
    loaded = load_config(config, set_ or []).bridge
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="%(asctime)s router %(levelname)s %(message)s")
    log = logging.getLogger(ROUTER)
    with ExitStack() as stack:
        stop = stack.enter_context(StopSignals())
        if loaded.keys:
            stack.enter_context(WireLog(log))
        session = stack.enter_context(closing(open_session(loaded, ROUTER)))
        log.info("listens on %s", ", ".join(loaded.router_listen))
        watch = LinkWatch(session, log)
        while stop.seen is None:
            watch.look()
            time.sleep(POLL_S)
