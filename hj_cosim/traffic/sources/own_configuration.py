"""A user's SUMO configuration (.sumocfg), read, and copied without what it would write: their files stay untouched.

SUMO resolves a configuration's paths from its folder, and writes what detectors and edge data collect into the folder
of the file that names them, whatever the command line says. So SUMO is started with copies, in a folder of ours, of
the configuration and of those files that would write.
"""

import gzip
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast
from xml.sax import SAXException, handler, make_parser
from xml.sax.saxutils import XMLFilterBase, XMLGenerator
from xml.sax.xmlreader import AttributesImpl

from hj_cosim.errors import ConfigurationError
from hj_cosim.settings import shown

NOWHERE = "/dev/null"
LARGEST_CONFIGURATION = 1_000_000  # bytes
READ_AT_ONCE = 1 << 20  # bytes
DEEPEST_INCLUDE = 10

# Options under all of the names that SUMO has for them.
NETWORK = ("net-file", "net", "n")
ROUTES = ("route-files", "routes", "r")
ADDITIONAL = ("additional-files", "additional", "a")
STATE = "load-state"
BEGIN, END, STEP = ("begin", "b"), ("end", "e"), ("step-length",)
_WRITES = re.compile(
    r".*-output(\..*)?|netstate(-dump)?(\..*)?|n?dump|tripinfo(\..*)?|vehroutes?(\..*)?|summary|l|log(-file)?|error-log"
    r"|message-log|save-.*|device\..*\.file|output-(prefix|suffix)|write-license|linkoutput|capacity-output"
)
# What SUMO would print, wait for, or show.
_TALKS = re.compile(
    r"v|verbose|p|print-options|t|duration-log\..*|no-step-log|step-log\..*|no-warnings|W|remote-port|num-clients"
    r"|gui-settings-file|g|game(\..*)?|start|S|quit-on-end|Q|gui-.*|window-.*|random|seed|step-method\.ballistic"
)
# Elements whose `file` is read; every other one's is written.
_READS_ITS_FILE = frozenset({"rerouter", "variableSpeedSign", "vss", "include"})
_MAY_WRITE = re.compile(rb"\b(file|dest|output)\s*=|\.file[\"']|<\s*include\b")


@dataclass(frozen=True)
class OwnConfiguration:
    """What a user's .sumocfg says, ready to be run without writing anything of its own.

    Attributes:
        path: the user's.
        copy: the one to start SUMO with.
        network: the network's file.
        begin: s, of the simulation.
        end: s; inf if it has none.
        step: s, the user's own.
        options: of the copy, as written.
        silenced: what would have been written, a few words each.
    """

    path: Path
    copy: Path
    network: Path
    begin: float
    end: float
    step: float
    options: Mapping[str, str]
    silenced: tuple[str, ...]


def copy_configuration(path: Path, folder: Path, added: Path | None = None) -> OwnConfiguration:
    """Read a user's configuration, and write into `folder` what SUMO is to be started with in its place.

    Args:
        path: theirs.
        folder: ours.
        added: an additional file of ours.

    Raises:
        ConfigurationError: if it, or a file that it names, is missing or is no SUMO file, or it names no network.
    """
    given = read_options(path)
    silenced = [f"{name} = {value}" for name, value in given.items() if _WRITES.fullmatch(name)]
    options = {name: value for name, value in given.items() if not (_WRITES.fullmatch(name) or _TALKS.fullmatch(name))}
    networks = [value for name in NETWORK if (value := options.get(name))]
    if not networks:
        raise ConfigurationError(f'{path} names no network; write <net-file value="....net.xml"/> into its <input>')
    copies = _Copies(folder)
    for name, value in options.items():
        parts = [_absolute(path.parent, part.strip()) for part in value.split(",")]
        if name in (*ROUTES, *ADDITIONAL):
            parts = [str(copies.silent(Path(part))) for part in parts if part]
        options[name] = ",".join(parts)
    if added is not None:
        name = next((each for each in ADDITIONAL if each in options), ADDITIONAL[0])
        options[name] = ",".join([*filter(None, [options.get(name)]), str(added)])
    network = Path(_absolute(path.parent, networks[0]))
    for name, named in (("net-file", networks[0]), (STATE, given.get(STATE))):
        if named and not Path(_absolute(path.parent, named)).is_file():
            raise ConfigurationError(f"{path}: {name} = {shown(repr(named))}: there is no such file")
    copy = folder / "own.sumocfg"
    with copy.open("w", encoding="utf-8") as file:
        writer = XMLGenerator(file, "utf-8")
        writer.startElement("configuration", AttributesImpl({}))
        for name, value in options.items():
            writer.startElement(name, AttributesImpl({"value": value}))
            writer.endElement(name)
        writer.endElement("configuration")
    return OwnConfiguration(
        path=path,
        copy=copy,
        network=network,
        begin=_seconds(path, given, BEGIN, 0.0),
        end=_end(path, given),
        step=_seconds(path, given, STEP, 1.0),
        options=options,
        silenced=(*silenced, *copies.silenced),
    )


def read_options(path: Path) -> dict[str, str]:
    """Return the options of a configuration, by the names that it has for them, in its order.

    Raises:
        ConfigurationError: if there is no such file, or it is no configuration of SUMO's.
    """
    options: dict[str, str] = {}
    roots: list[str] = []

    class Options(handler.ContentHandler):
        def startElement(self, name: str, attributes: Any) -> None:
            roots.append(name)
            value = attributes.get("value", attributes.get("v"))
            if value is not None:
                options[name] = value

    if path.is_file() and path.stat().st_size > LARGEST_CONFIGURATION:
        raise ConfigurationError(f"{path} is too large for a SUMO configuration")
    _parse(path, Options())
    if not roots:
        raise ConfigurationError(f"{path} is not XML: it is empty")
    if roots[0] not in ("configuration", "sumoConfiguration", "sumo-configuration"):
        raise ConfigurationError(f"{path} is no SUMO configuration: its root is <{roots[0]}>, not <configuration>")
    return options


def own_seed(path: Path) -> int:
    """Return the seed that a configuration states; 0 if it states none, or none that is a number.

    Raises:
        ConfigurationError: as read_options.
    """
    text = read_options(path).get("seed", "")
    return int(text) if text.isdecimal() else 0


def _absolute(folder: Path, name: str) -> str:
    """Return a file's absolute path if `name` is that of one; anything else as it is."""
    try:
        place = folder / name
        return str(place.resolve()) if name and place.is_file() else name
    except (OSError, ValueError):  # a value that no file can be called
        return name


def _seconds(path: Path, options: Mapping[str, str], names: Sequence[str], default: float) -> float:
    """Return a time of the options, in s, which SUMO also takes as HH:MM:SS or DD:HH:MM:SS."""
    found = [(name, options[name]) for name in names if name in options]
    if not found:
        return default
    name, text = found[0]
    try:
        *longer, seconds = (float(part) for part in text.split(":"))
        factors = (60.0, 3600.0, 86400.0)
        value = seconds + sum(part * factor for part, factor in zip(reversed(longer), factors, strict=False))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ConfigurationError(f"{path}: {name} = {shown(repr(text))} is no time in seconds")
    return value


def _end(path: Path, options: Mapping[str, str]) -> float:
    end = _seconds(path, options, END, -1.0)
    return end if end >= 0.0 else math.inf


class _Copies:
    """Copies of route and additional files, of those that would write or that name others by relative paths."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._done: dict[Path, Path] = {}
        self.silenced: list[str] = []

    def silent(self, path: Path, depth: int = 0) -> Path:
        """Return the file, or a copy of it that writes nothing if it would write."""
        if path in self._done:
            return self._done[path]
        if depth > DEEPEST_INCLUDE:
            raise ConfigurationError(f"{path} is included by a file that it includes; take that out")
        if not _may_write(path):
            return path
        copy = self._folder / f"{len(self._done)}-{path.name.removesuffix('.gz')}"
        self._done[path] = copy
        with copy.open("w", encoding="utf-8") as file:
            _parse(path, _Silencer(path, self, XMLGenerator(file, "utf-8"), depth))
        return copy


class _Silencer(XMLFilterBase):
    """Passes a file's elements on, with what they would write sent nowhere."""

    def __init__(self, path: Path, copies: _Copies, writer: XMLGenerator, depth: int) -> None:
        super().__init__()
        self._path, self._copies, self._depth = path, copies, depth
        self.setContentHandler(writer)

    def startElement(self, name: str, attributes: Any) -> None:
        changed = dict(attributes.items())
        written = ["dest", "output"] if name in ("timedEvent", "calibrator") else []
        if name not in _READS_ITS_FILE:
            written.append("file")
        for key in written:
            if key in changed:
                self._note(name, changed, changed[key])
                changed[key] = NOWHERE
        if name in _READS_ITS_FILE and "file" in changed:
            changed["file"] = _absolute(self._path.parent, changed["file"])
        if name == "include" and "href" in changed:
            included = Path(_absolute(self._path.parent, changed["href"]))
            changed["href"] = str(self._copies.silent(included, self._depth + 1))
        if name == "param" and changed.get("key", "").endswith(".file"):
            self._note(changed["key"], changed, changed.get("value", ""))
            changed["value"] = NOWHERE
        super().startElement(name, AttributesImpl(changed))

    def _note(self, what: str, attributes: Mapping[str, str], target: str) -> None:
        name = f" {attributes['id']}" if "id" in attributes else ""
        self._copies.silenced.append(f"{what}{name} of {self._path.name} -> {target}")


def _may_write(path: Path) -> bool:
    """Return whether anything in a file could write, by its bytes. That a file is missing is SUMO's to say."""
    last = b""
    try:
        with _opened(path) as file:
            while piece := file.read(READ_AT_ONCE):
                if _MAY_WRITE.search(last + piece):
                    return True
                last = piece[-100:]
    except (OSError, EOFError):
        return False
    return False


def _opened(path: Path) -> IO[bytes]:
    return cast(IO[bytes], gzip.open(path) if path.suffix == ".gz" else path.open("rb"))


class _NoDoctype(handler.LexicalHandler):
    def __init__(self, path: Path) -> None:
        self._path = path

    def startDTD(self, name: str, public_id: str | None, system_id: str | None) -> None:
        raise ConfigurationError(f"{self._path} has a DOCTYPE, which SUMO's files do not have; remove it")


def _parse(path: Path, receiver: handler.ContentHandler | XMLFilterBase) -> None:
    """Parse an XML file, packed or not; nothing outside it is read, nothing in it expanded.

    Raises:
        ConfigurationError: if it cannot be read.
    """
    parser = make_parser()
    parser.setFeature(handler.feature_external_ges, False)
    parser.setProperty(handler.property_lexical_handler, _NoDoctype(path))
    parser.setContentHandler(receiver)
    try:
        with _opened(path) as file:
            while piece := file.read(READ_AT_ONCE):
                parser.feed(piece)  # type: ignore[attr-defined]  # what expat's reader has beyond the interface
        parser.close()  # type: ignore[attr-defined]
    except SAXException as error:
        raise ConfigurationError(f"{path} is not XML: {error.getMessage()}") from error
    except (OSError, EOFError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigurationError(
            f"cannot read {path}: {reason}; give a .sumocfg with the files that it names"
        ) from error
