"""A robot's URDF with its sidecar's values in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from picchio.core.errors import InputError
from picchio.core.files import atomic_write
from picchio.core.provenance import provenance
from picchio.core.results import Result
from picchio.robot.annotations.annotate import annotate as annotated
from picchio.robot.annotations.sidecar import read_sidecar
from picchio.robot.loading.find import find_robot
from picchio.robot.loading.objects import RobotLike, named


@dataclass(eq=False, repr=False)
class AnnotatedUrdf(Result):
    """A URDF with annotations; `save` writes it.

    Attributes:
        content: the file's bytes.
        urdf: the file that was annotated.
        sidecar: where the values are from.
        file: where it was saved last, or None.
    """

    LACKS: ClassVar = dict.fromkeys(("plot", "show", "to_frame"), "it is a file: load it")

    content: bytes
    urdf: Path
    sidecar: Path
    file: Path | None = None

    def save(self, path: str | Path) -> Path:
        """Write the URDF to a file, whole or not at all.

        Args:
            path: of the file.

        Returns:
            the path.

        Raises:
            OutputError: it cannot be written there.
        """
        with atomic_write(path, "wb") as stream:
            stream.write(self.content)
        self.file = Path(path)
        return self.file

    def _headline(self) -> str:
        return f"{self.urdf.name} with the values of {self.sidecar.name}"

    def _content(self) -> dict[str, Any]:
        return {
            "format": "picchio-annotation/1",
            "file": self.file,
            "provenance": provenance([self.urdf, self.sidecar]),
        }


def annotate(robot: RobotLike, *, flex: str | Path | None = None) -> AnnotatedUrdf:
    """A URDF with a sidecar's values as annotations; everything else in it stays as it is.

    Args:
        robot: as `load_robot` takes it; of one that is loaded, its files. No meshes are copied.
        flex: the sidecar; the robot's own flex.toml if None.

    Raises:
        InputError: no sidecar, or one that does not go with the URDF.
    """
    found = find_robot(named(robot))
    sidecar = flex or found.flex
    if sidecar is None:
        raise InputError("this robot has no flex.toml of its own", key="flex",
                         hint="name a sidecar")  # fmt: skip
    return AnnotatedUrdf(annotated(found.urdf, read_sidecar(sidecar)), found.urdf, Path(sidecar))
