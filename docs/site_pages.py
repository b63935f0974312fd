"""Give the site the same folders as the repository, so that links hold in both."""

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
SHOWN = ("*.md", "docs/*.md", "docs/pictures/*", "bench/**/*.md", "config/*.yaml", "LICENSE")


def on_files(files: Files, config: Any) -> Files:
    """Take the theme's own files, and pages and pictures where they lie in the repository."""
    theirs = [file for file in files if file.src_dir != config.docs_dir]
    paths = [path.relative_to(ROOT) for pattern in SHOWN for path in sorted(ROOT.glob(pattern))]
    ours = [File.generated(config, str(path), abs_src_path=str(ROOT / path)) for path in paths]
    return Files([*theirs, *ours])
