"""Files that appear whole or not at all."""

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hj_cosim.errors import HjCosimError

LONGEST_NAME = 200  # bytes; a file system takes 255, and a stack, a seed and a temporary name's letters are added


def file_name(text: str) -> str:
    """Return a text, whoever wrote it, as a part of a file's name: no separator, no dot in front, not too long."""
    allowed = re.sub(r"[^\w.,=+-]", "_", text).lstrip(".").encode()
    return allowed[:LONGEST_NAME].decode(errors="ignore") or "_"


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; it takes `path`'s place when the block ends without an error.

    Args:
        path: where the file is to appear; missing folders are made.

    Yields:
        The temporary path to write to, with `path`'s suffix.

    Raises:
        HjCosimError: if the folder cannot be written or the disk is full.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise HjCosimError(f"cannot write {path}: {error.strerror}; choose another place or free it") from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes the file private; what we write is as readable as any other file of the user.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    except OSError as error:
        raise HjCosimError(f"cannot write {path}: {error.strerror}; choose another place or free it") from error
    finally:
        temporary.unlink(missing_ok=True)
