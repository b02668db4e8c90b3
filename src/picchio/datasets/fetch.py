"""Where a data set's files are, a folder or the authors' repository, and how they are read."""

from __future__ import annotations

import gzip
import hashlib
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from picchio.core.errors import InputError, warn_user

VARIABLE = "PICCHIO_DATA"


@dataclass(frozen=True)
class RemoteFile:
    """One file of a data set.

    Attributes:
        path: within the repository.
        sha256: of its bytes there.
    """

    path: str
    sha256: str


@dataclass(frozen=True)
class Dataset:
    """A data set's origin.

    Attributes:
        name: as `load` takes it.
        repository: "owner/name" on GitHub.
        commit: the full hash.
        licence: of the repository.
        cite: whom to name.
        files: by local name; a local copy may also be gzipped (".gz" after the name).
    """

    name: str
    repository: str
    commit: str
    licence: str
    cite: str
    files: Mapping[str, RemoteFile]

    def address(self, name: str) -> str:
        """Where a file is downloaded from.

        Args:
            name: of the file in this data set.
        """
        path = quote(self.files[name].path)
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{path}"

    def provenance(self) -> dict[str, object]:
        """For `campaign.toml`."""
        return {
            "source": f"https://github.com/{self.repository}",
            "commit": self.commit,
            "licence": self.licence,
            "cite": self.cite,
            "inputs": [{"file": n, "sha256": f.sha256} for n, f in self.files.items()],
        }


def find_files(dataset: Dataset, folder: str | Path | None) -> dict[str, Path]:
    """All files of a data set on this machine.

    Args:
        dataset: which.
        folder: where they are; by PICCHIO_DATA, else downloaded, where None.

    Raises:
        InputError: missing from the folder named, or the download fails.
    """
    if folder is not None:
        return _local(dataset, Path(folder))
    if given := os.environ.get(VARIABLE):
        home = Path(given) / dataset.name
        if home.is_dir():
            return _local(dataset, home)
        if not Path(given).is_dir():
            raise InputError("no such folder", file=given, key=VARIABLE)
    return {name: _download(dataset, name) for name in dataset.files}


def _local(dataset: Dataset, folder: Path) -> dict[str, Path]:
    inner = folder / dataset.name
    home = inner if inner.is_dir() else folder
    found = {}
    for name, remote in dataset.files.items():
        path = next((p for p in (home / name, home / f"{name}.gz") if p.is_file()), None)
        if path is None:
            raise InputError(f"a file of the data set {dataset.name} is missing", file=home,
                             value=name)  # fmt: skip
        if hashlib.sha256(content(path)).hexdigest() != remote.sha256:
            text = f"{path}: is not the file that {dataset.name} was made for (SHA-256 differs)"
            warn_user(text)
        found[name] = path
    return found


def content(path: Path) -> bytes:
    """The bytes of a file, unpacked where it is gzipped.

    Args:
        path: the file.

    Raises:
        InputError: it can't be read.
    """
    try:
        data = path.read_bytes()
        return gzip.decompress(data) if path.suffix == ".gz" else data
    except (OSError, EOFError) as error:
        raise InputError(f"cannot be read: {error}", file=path) from None


def load_variables(path: Path, names: Sequence[str]) -> dict[str, Any]:
    """The variables of a .mat file by name; structs as objects with their fields.

    Args:
        path: the file.
        names: of the variables.

    Raises:
        InputError: no .mat file, or a variable is missing.
    """
    from scipy.io import loadmat

    try:
        with warnings.catch_warnings():
            # The KUKA files hold one opaque MATLAB object beside the data.
            warnings.simplefilter("ignore")
            found = loadmat(path, squeeze_me=True, struct_as_record=False, variable_names=names)
    except Exception as error:  # scipy raises many kinds on a broken file
        reason = str(error).partition("\n")[0]
        raise InputError(f"is not a readable .mat file: {reason}", file=path) from None
    for name in names:
        if name not in found:
            raise InputError("the variable is missing", file=path, key=name)
    return {name: found[name] for name in names}


def _download(dataset: Dataset, name: str) -> Path:
    try:
        import pooch
    except ImportError:
        raise InputError(
            f"downloading {dataset.name} needs pooch",
            hint=f"pip install 'picchio[data]', or put the files in a folder and set {VARIABLE}",
        ) from None
    remote = dataset.files[name]
    home = pooch.os_cache("picchio") / dataset.name / dataset.commit[:12]
    address = dataset.address(name)
    try:
        got = pooch.retrieve(
            address, known_hash=f"sha256:{remote.sha256}", fname=name, path=home, progressbar=False
        )
    except ValueError as error:
        if "hash" not in str(error).lower():
            raise InputError(f"cannot be downloaded: {error}", file=address) from None
        raise InputError("the download is not the file expected: its SHA-256 is wrong",
                         file=address, hint="nothing was kept") from None  # fmt: skip
    except Exception as error:  # whatever the network raises
        raise InputError(
            f"cannot be downloaded: {type(error).__name__}",
            file=address,
            hint=f"put the files in a folder and set {VARIABLE}",
        ) from None
    return Path(got)
