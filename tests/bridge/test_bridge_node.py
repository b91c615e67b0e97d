"""What every node process does before its first turn."""

from __future__ import annotations

from bridge.clock import ManualClock
from bridge.node import await_roles
from bridge.transport.memory import MemoryHub


def test_a_node_waits_for_the_roles_it_comes_after() -> None:
    hub = MemoryHub(ManualClock())
    transport = hub.transport()
    hub.transport().declare_alive("anticipation")
    asked = 0

    def controller_comes_up() -> bool:
        nonlocal asked
        asked += 1
        if asked == 2:
            hub.transport().declare_alive("controller")
        return False

    assert await_roles(transport, ["anticipation", "controller"], 60.0, controller_comes_up)
    assert asked >= 2


def test_it_waits_neither_for_ever_nor_against_a_stop() -> None:
    hub = MemoryHub(ManualClock())
    assert not await_roles(hub.transport(), ["controller"], 0.0, lambda: False)
    assert not await_roles(hub.transport(), ["controller"], 60.0, lambda: True)
    assert await_roles(hub.transport(), [], 0.0, lambda: False)
