"""Hooks that hatchling runs when it builds the wheel and the source distribution.

They fill in what an index page shows, the addresses of the project and a README whose links work,
and add the notebooks to the wheel. `repository` in pyproject.toml is the only place for the address
of the repository. Without it, the README has its links and pictures removed.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

#: Folders of notebooks that are not for students.
HIDDEN = {"solutions", ".ipynb_checkpoints"}
#: A Markdown link or picture whose target is a file of the repository.
RELATIVE = re.compile(r"(!?)\[([^\]]*)\]\((?!\w+:|#)([^)]+)\)")


def readme(text: str, tree: str) -> str:
    """Return the README with links into `tree`, or without links if there is no tree."""

    def absolute(link: re.Match[str]) -> str:
        picture, words, target = link.groups()
        if not tree:
            return "" if picture else words
        return f"{picture}[{words}]({tree.format('raw' if picture else 'blob')}/{target})"

    return RELATIVE.sub(absolute, text)


class CustomMetadataHook(MetadataHookInterface):
    def update(self, metadata: dict[str, Any]) -> None:
        address = self.config["repository"].rstrip("/")
        tree = address and f"{address}/{{}}/v{metadata['version']}"
        text = readme((Path(self.root) / "README.md").read_text(encoding="utf-8"), tree)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
        if address:
            changelog = f"{tree.format('blob')}/CHANGELOG.md"
            metadata["urls"] = {"Repository": address, "Changelog": changelog}
            metadata["urls"]["Issues"] = f"{address}/issues"


class CustomBuildHook(BuildHookInterface[Any]):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        for file in Path(self.root).glob("notebooks/**/*.ipynb"):
            part = file.relative_to(self.root)
            if not HIDDEN & set(part.parts):
                build_data["force_include"][str(file)] = f"shipnet/{part.as_posix()}"
