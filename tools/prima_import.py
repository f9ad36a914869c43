"""Imports official network weights: the Lightning checkpoint, BioCLIP from OpenCLIP, and AniMer's backbone.

The result is a safetensors file with the official tensor names. Its metadata holds the network's config
("prima_config", see model/checkpoint.h).
"""

from __future__ import annotations

import json
from collections import Counter
from typing import Callable, Mapping, Optional, Sequence

import prima_names as names
import safetensors_file
from restricted_pickle import Record
from safetensors_file import Tensor
from torch_checkpoint import TorchFile

CONFIG_KEY = "prima_config"
# The domain with which build and calibrate compare a pool (pipeline/device/domain.h). The paper's tables have AUC and
# PCK, which give no quantile of L_proj; tools/describe_checkpoint.py adds them for those who have its test sets.
DOMAIN_KEY = "prima_domain"
OFFICIAL_DOMAIN = {
    "pictures": "photographs",
    "trained_on": "the official PRIMA data: Animal3D, CtrlAni3D and Quadruped2D or Quadruped3D (arXiv:2606.02366)",
}
_WEIGHT_DTYPES = ("F32", "F16", "BF16")
_MAX_FAULTS_SHOWN = 40
_MAX_LAYERS = 10_000  # a hostile file's config could ask for the names of a billion

Say = Callable[[str], None]


class ImportFault(ValueError):
    """A file does not fit the network. The message says what, where, what was found, what was expected, what to do."""


# --- the Lightning checkpoint --------------------------------------------------------------------------------------


def import_checkpoint(
    source: str,
    target: str,
    say: Say,
    settings: dict = {},
    open_clip_config: Optional[str] = None,
    keep_text: bool = False,
    drop: Sequence[str] = (),
    check_sums: bool = True,
) -> None:
    """Converts a Lightning checkpoint, or a bare state dict, to a safetensors file.

    settings: config values that take precedence over those of the file. open_clip_config: path of BioCLIP's config.
    keep_text: keep CLIP's text tower. drop: prefixes of unknown tensors to leave out. check_sums: compare the zip's
    check sums. Throws ImportFault, TensorFileError, BrokenPickle, RefusedPickle and OSError, and then writes nothing.
    """
    file = TorchFile(source, check_sums)
    root = _entries(file.root) or {}
    tensors = file.tensors(root.get("state_dict", file.root), "state_dict")
    shapes = {name: tensor.shape for name, tensor in tensors.items()}
    config = names.config_from_shapes(shapes)
    expected = names.expected_tensors(config, names.text_from_shapes(shapes))
    unknown = [name for name in tensors if name not in expected]
    dropped = [name for name in unknown if name.startswith(tuple(drop))]
    faults = find_faults(tensors, expected)
    faults += [f"{name}: extra, {tensors[name]}" for name in unknown if name not in dropped]
    if faults:
        advice = "If an extra tensor is known to be of no use, leave it out with --drop PREFIX."
        raise ImportFault(_fault_list(source, faults, advice))
    if open_clip_config:
        settings = _open_clip_settings(open_clip_config, config) | settings
    origin = _apply_settings(config, settings, root.get("hyper_parameters"))
    kept = [name for name in expected if name in tensors and (keep_text or expected[name].group != names.TEXT)]
    metadata = _metadata(config, source) | {DOMAIN_KEY: json.dumps(OFFICIAL_DOMAIN)}
    safetensors_file.write(target, {name: tensors[name] for name in kept}, metadata)

    groups = Counter(expected[name].group for name in kept)
    say(f"{target}: {len(kept)} of {len(tensors)} tensors ({', '.join(f'{key} {groups[key]}' for key in groups)})")
    if text := len(tensors) - len(kept) - len(dropped):
        say(f"  left out: {text} of CLIP's text tower, which the network does not use (--keep-text keeps it)")
    if dropped:
        say(f"  left out by --drop: {', '.join(dropped[:8])}{', ...' if len(dropped) > 8 else ''}")
    if absent := sorted({item.group for item in expected.values()} - set(groups) - {names.TEXT}):
        say(f"  not in the file, and not needed to predict: {', '.join(absent)}")
    say("  sizes: " + " ".join(f"{key}={config[key]}" for key in config if key not in names.FREE_KEYS))
    say("  not given by the weights: " + " ".join(f"{key}={config[key]} ({origin[key]})" for key in names.FREE_KEYS))


def find_faults(tensors: Mapping[str, Tensor], expected: Mapping[str, names.Expected]) -> list[str]:
    """Lists the expected tensors that are missing or have another shape or dtype, one message each. The network must be
    complete; every other group must be complete or absent."""
    present = {expected[name].group for name in tensors if name in expected} | {names.NETWORK}
    faults = []
    for name, item in expected.items():
        tensor = tensors.get(name)
        if tensor is None:
            if item.group in present:
                faults.append(f"{name}: missing, expected {item.dtype} {list(item.shape)}")
            continue
        if tensor.shape != item.shape:
            faults.append(f"{name}: shape {list(tensor.shape)}, expected {list(item.shape)}")
        allowed = _WEIGHT_DTYPES if item.dtype == "F32" else (item.dtype,)
        if tensor.dtype not in allowed:
            faults.append(f"{name}: dtype {tensor.dtype}, expected {' or '.join(allowed)}")
    return faults


def _apply_settings(config: dict, settings: Mapping, hyperparameters) -> dict[str, str]:
    """Sets the values that the shapes do not determine. Returns the origin of each such value."""
    origin = {key: "official" for key in names.FREE_KEYS}
    places = {
        "ief_iterations": ("MODEL", "SMAL_HEAD", "IEF_ITERS"),
        "dec_heads": ("MODEL", "SMAL_HEAD", "NUM_HEADS"),
        "focal_px": ("SMAL", "FOCAL_LENGTH"),
    }
    for key, place in places.items():
        value = _setting(hyperparameters, place)
        if _same_kind(value, config[key]):
            config[key] = type(config[key])(value)
            origin[key] = "the file's hyperparameters"
    for key, value in settings.items():
        if key not in config:
            raise ImportFault(f"unknown config key '{key}', expected one of {', '.join(config)}")
        if not _same_kind(value, config[key]):
            raise ImportFault(f"config '{key}' is {value!r}, expected a value like {config[key]!r}")
        if key not in names.FREE_KEYS and value != config[key]:
            raise ImportFault(f"config '{key}' is {value}, but the weights' shapes say {config[key]}")
        config[key] = value
        origin[key] = "given"
    for part, whole in (("heads", "embed_dim"), ("clip_heads", "clip_width"), ("dec_heads", "dec_dim")):
        if config[part] < 1 or config[whole] % config[part]:
            raise ImportFault(
                f"'{part}' = {config[part]} ({origin[part]}) does not divide '{whole}' = {config[whole]}; "
                f"give the right number: --set {part}=N"
            )
    return origin


def _same_kind(value, like) -> bool:
    if isinstance(like, bool) or isinstance(value, bool):
        return isinstance(like, bool) and isinstance(value, bool)
    return isinstance(value, int) or (isinstance(like, float) and isinstance(value, float))


def _is_like_official(key: str, value) -> bool:
    """Whether a value of a config has the official one's type, and a count is one from which names can be made."""
    if not _same_kind(value, names.OFFICIAL_CONFIG[key]):
        return False
    return not key.endswith(("depth", "layers")) or 0 <= value <= _MAX_LAYERS


def _setting(node, place: Sequence[str]):
    """Returns a value of the hyperparameters, or None when it is absent. They may be dicts, yacs nodes (records with
    dict items), or omegaconf nodes (records whose state holds `_content` and, in the leaves, `_val`)."""
    node = (_entries(node) or {}).get("cfg", node)
    for key in place:
        node = (_entries(node) or {}).get(key)
    if isinstance(node, Record) and isinstance(node.state, dict):
        node = node.state.get("_val")
    return node


def _entries(node):
    """Returns the dict that a node is, or that its record describes; otherwise None."""
    if isinstance(node, Record):
        content = node.state.get("_content") if isinstance(node.state, dict) else None
        return content if isinstance(content, dict) else node.entries
    return node if isinstance(node, dict) else None


# --- parts of other networks ------------------------------------------------------------------------------------------


def import_backbone(source: str, base: str, target: str, say: Say, check_sums: bool = True) -> None:
    """Replaces the ViT in the checkpoint `base` by AniMer's in `source` (backbone.*, with or without this prefix)."""
    tensors = _load(source, check_sums)
    prefix = "backbone."
    found = {name: tensor for name, tensor in tensors.items() if name.startswith(prefix)}
    if not found:
        found = {prefix + name: tensor for name, tensor in tensors.items()}
    _merge(source, found, base, target, prefix, {}, say, ignored=len(tensors) - len(found))


def import_bioclip(
    source: str, open_clip_config: str, base: str, target: str, say: Say, check_sums: bool = True
) -> None:
    """Replaces the BioCLIP encoder in the checkpoint `base` by the image tower of an OpenCLIP file."""
    tensors = _load(source, check_sums)
    prefix = names.CLIP + "visual."
    found = {names.CLIP + name: tensor for name, tensor in tensors.items() if name.startswith("visual.")}
    shapes = {name: tensor.shape for name, tensor in found.items()}
    sizes = {key: value for key, value in names.config_from_shapes(shapes).items() if key.startswith("clip_")}
    sizes.update(_open_clip_settings(open_clip_config, sizes))
    _merge(source, found, base, target, prefix, sizes, say, ignored=len(tensors) - len(found))


def _open_clip_settings(path: str, sizes: Mapping) -> dict:
    """Reads quick GELU and the number of heads from an open_clip_config.json, and checks that it fits the weights.

    Its form is {"model_cfg": {"quick_gelu": ..., "vision_cfg": {"width", "layers", "head_width"}}}. OpenCLIP's defaults
    are the ordinary GELU and 64 channels per head.
    """
    try:
        with open(path, encoding="utf-8") as file:
            root = json.load(file)
        model = root.get("model_cfg", root)
        vision = model["vision_cfg"]
        quick_gelu, head_width = model.get("quick_gelu", False), vision.get("head_width", 64)
        told = {"clip_width": vision["width"], "clip_layers": vision["layers"], "clip_out": model["embed_dim"]}
        patch = vision.get("patch_size", names.PATCH_PX)
    except (ValueError, KeyError, AttributeError, TypeError, RecursionError) as error:
        raise ImportFault(f"{path}: not an open_clip_config.json ({type(error).__name__}: {error})") from None
    if not isinstance(quick_gelu, bool):
        raise ImportFault(f"{path}: model_cfg.quick_gelu is {quick_gelu!r}, expected true or false")
    for key, value in told.items():
        if value != sizes[key]:
            raise ImportFault(f"{path}: {key} is {value}, but {sizes[key]} in the weights: is it of another model?")
    if patch != names.PATCH_PX or not isinstance(head_width, int) or head_width < 1:
        raise ImportFault(f"{path}: patch_size {patch}, head_width {head_width}; expected {names.PATCH_PX} and a width")
    return {"clip_quick_gelu": quick_gelu, "clip_heads": sizes["clip_width"] // head_width}


def _load(path: str, check_sums: bool) -> dict[str, Tensor]:
    with open(path, "rb") as file:
        start = file.read(9)
    if start[8:9] == b"{":  # the header of a safetensors file
        return safetensors_file.read(path)[0]
    file = TorchFile(path, check_sums)
    return file.tensors((_entries(file.root) or {}).get("state_dict", file.root), "state_dict")


def _merge(
    source: str, found: dict, base: str, target: str, prefix: str, sizes: Mapping, say: Say, ignored: int
) -> None:
    """Writes a copy of `base` whose tensors prefix* are replaced by `found`, with `sizes` in its config."""
    tensors, metadata = safetensors_file.read(base)
    try:
        config = names.OFFICIAL_CONFIG | json.loads(metadata[CONFIG_KEY])
        if unlike := [key for key in config if key in names.OFFICIAL_CONFIG and not _is_like_official(key, config[key])]:
            raise ValueError(unlike)
    except (KeyError, ValueError, TypeError, RecursionError):
        raise ImportFault(
            f"{base}: no usable '{CONFIG_KEY}' in its metadata; create the file with `import_assets.py checkpoint` or with "
            "`quadruped3d init --size vith`"
        ) from None
    config.update(sizes)
    expected = names.expected_tensors(config)
    wanted = {name: item for name, item in expected.items() if name.startswith(prefix)}
    faults = find_faults({name: found[name] for name in wanted if name in found}, wanted)
    faults += [f"{name}: extra, {found[name]}" for name in found if name.startswith(prefix) and name not in wanted]
    if faults:
        raise ImportFault(_fault_list(source, faults, f"It has to fit the sizes in {base}."))
    merged = {name: tensor for name, tensor in tensors.items() if name not in wanted}
    merged.update({name: found[name] for name in wanted})
    network = {name: item for name, item in expected.items() if item.group == names.NETWORK}
    if faults := find_faults({name: merged[name] for name in network if name in merged}, network):
        raise ImportFault(_fault_list(base, faults, f"The other tensors of this file do not fit {source}."))
    order = [name for name in expected if name in merged] + [name for name in merged if name not in expected]
    safetensors_file.write(target, {name: merged[name] for name in order}, metadata | {CONFIG_KEY: json.dumps(config)})
    say(f"{target}: {len(wanted)} tensors {prefix}* from {source}, {len(merged) - len(wanted)} from {base}")
    if ignored:
        say(f"  not used: {ignored} other tensors of {source}")
    if sizes:
        say("  " + " ".join(f"{key}={value}" for key, value in sizes.items()))


# --- shared --------------------------------------------------------------------------------------------------------


def _metadata(config: Mapping, source: str) -> dict[str, str]:
    return {CONFIG_KEY: json.dumps(config), safetensors_file.SOURCE_KEY: safetensors_file.source_names([source])}


def _fault_list(path: str, faults: list[str], advice: str) -> str:
    shown = "".join(f"\n  {fault[:300]}" for fault in faults[:_MAX_FAULTS_SHOWN])
    more = f"\n  ... and {len(faults) - _MAX_FAULTS_SHOWN} more" if len(faults) > _MAX_FAULTS_SHOWN else ""
    verb = "tensor does" if len(faults) == 1 else "tensors do"
    return f"{path}: {len(faults)} {verb} not fit the network:{shown}{more}\n{advice}"
