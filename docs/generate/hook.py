"""What `make docs` adds to the pages in docs/ (an MkDocs hook): pages from elsewhere in the repository, and tables.

- README, CONTRIBUTING, CHANGELOG and the model card become pages of the site; they exist once, where they are.
- A link to a file or folder of the repository that is no page leads to a page that shows it.
- A line `<!-- generated: NAME -->` is replaced by what `TABLES[NAME]` writes from the code itself.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, Final

from commands_reference import command_reference
from configuration_reference import configuration_reference
from messages_reference import message_reference, topic_reference
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page
from repository import ELSEWHERE, REPO, Links, show

TABLES: Final[dict[str, Callable[[], str]]] = {
    "commands": command_reference,
    "configuration": configuration_reference,
    "messages": message_reference,
    "topics": topic_reference,
}

_shown = Links()


def on_files(files: Files, config: Any) -> Files:
    """Add the pages whose text is elsewhere in the repository, and those that show linked files."""
    for source, page in ELSEWHERE.items():
        files.append(File.generated(config, page, content=(REPO / source).read_text(encoding="utf-8")))
    for file in list(files.documentation_pages()):
        _shown.rewrite(file.content_string, origin(file.src_uri), file.src_uri)
    for page, path in sorted(_shown.pages.items()):
        files.append(File.generated(config, page, content=show(path), inclusion=InclusionLevel.NOT_IN_NAV))
    return files


def on_page_markdown(markdown: str, page: Page, config: Any, files: Files) -> str:
    """Fill in the generated tables, and lead links that leave docs/ to their pages."""
    del config, files
    uri = page.file.src_uri
    if uri in _shown.pages:
        return markdown
    text = _shown.rewrite(markdown, origin(uri), uri)
    return re.sub(r"<!-- generated: (\w+) -->", lambda match: TABLES[match[1]](), text)


def origin(uri: str) -> str:
    """Return where in the repository the text of a page stands."""
    return {page: source for source, page in ELSEWHERE.items()}.get(uri, f"docs/{uri}")
