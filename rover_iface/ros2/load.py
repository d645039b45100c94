"""Reading a mapping file: YAML, checked against the dictionary that it names."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from executive.crl.dictionary import Dictionary
from executive.crl.errors import DictionaryError
from rover_iface.errors import MappingError
from rover_iface.profile import dictionary_file
from rover_iface.ros2.consistency import contradictions
from rover_iface.ros2.mapping import MAPPINGS, Ros2Mapping


@dataclass(frozen=True, slots=True)
class Mapped:
    """A mapping with the dictionary that it names."""

    mapping: Ros2Mapping
    language: Dictionary


def load_mapping(path: Path) -> Mapped:
    """Return the mapping in a YAML file, checked against its dictionary.

    Raises
    ------
    MappingError
        If PyYAML is missing, the file is not YAML, a member is missing, unknown or out of range, or mapping
        and dictionary contradict each other.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as err:
        raise MappingError(f"{path}: cannot be read: {getattr(err, 'strerror', None) or err}") from err
    mapping = MAPPINGS.from_document(_parsed(text, path), str(path))
    named = mapping.dictionary
    try:
        language = dictionary_file(str(path.parent / named) if named.endswith((".toml", ".json")) else named)
    except DictionaryError as err:
        raise MappingError(f"{path}: dictionary is {named!r}: {err}") from err
    for wrong in contradictions(mapping, language):
        raise MappingError(f"{path}: {wrong}")
    return Mapped(mapping, language)


def _parsed(text: str, path: Path) -> object:
    """Return what a YAML text holds; a member that stands twice is refused, as YAML demands."""
    try:
        import yaml
    except ImportError as err:
        raise MappingError("mappings are YAML, which needs PyYAML: pip install 'outcrop[ros2]'") from err

    class Loader(yaml.SafeLoader):
        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):  # a short file with them can be endless
                raise yaml.YAMLError("it has an alias (*name), which is not taken")
            return super().compose_node(parent, index)

    def mapping_of(loader: Any, node: Any, **_: bool) -> dict[Hashable, Any]:
        loader.flatten_mapping(node)
        seen = [loader.construct_object(key, deep=True) for key, _ in node.value]
        twice = sorted({str(key) for key in seen if seen.count(key) > 1})
        if twice:
            raise yaml.YAMLError(f"{twice[0]} stands twice, line {node.start_mark.line + 1}")
        return dict(yaml.SafeLoader.construct_mapping(loader, node, deep=True))

    Loader.add_constructor("tag:yaml.org,2002:map", mapping_of)
    try:
        return yaml.load(text, Loader)
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as err:
        said = " ".join(str(err).split())
        raise MappingError(f"{path}: is not YAML: {said[:200]}") from err
