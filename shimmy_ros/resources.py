"""Where the package's data lie: in a source tree, a virtual environment or a colcon prefix."""

from __future__ import annotations

from pathlib import Path


def resource_directory(name: str) -> Path:
    """The directory ``name`` (config, msgs_spec or launch) that belongs to this package.

    Looks upward from this file for the source tree (the folder with package.xml) or an
    installation prefix (the one with share/shimmy_ros). Raises FileNotFoundError.
    """
    for parent in Path(__file__).resolve().parents:
        if (parent / "package.xml").is_file() and (parent / name).is_dir():
            return parent / name
        if (parent / "share" / "shimmy_ros" / name).is_dir():
            return parent / "share" / "shimmy_ros" / name
    raise FileNotFoundError(f"shimmy_ros is installed without its {name!r} directory")
