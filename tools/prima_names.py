"""Lists the tensors of the official checkpoint, with their names and shapes, for a network of any size.

It also derives the size of a network from the shapes of its tensors.

At the paper's size, the list has the 955 tensors of the released model's state dict.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Iterable, Mapping

JOINTS, BETAS, KEYPOINTS, FAMILIES = 35, 41, 26, 5
VERTICES, FACES = 3889, 7774
IMAGE_TOKENS = 16 * 12
CLIP_TOKENS = 14 * 14
PATCH_PX = 16
POSE_6D, CAMERA = 6 * JOINTS, 3

# The network's config at the paper's size, with the keys of the C++ code (model/config.h).
OFFICIAL_CONFIG = {
    "embed_dim": 1280,
    "depth": 32,
    "heads": 16,
    "mlp_ratio": 4,
    "clip_width": 768,
    "clip_layers": 12,
    "clip_heads": 12,
    "clip_out": 512,
    "clip_quick_gelu": False,
    "dec_dim": 1280,
    "dec_layers": 6,
    "dec_heads": 8,
    "dec_ffn": 5120,
    "ief_iterations": 1,
    "focal_px": 1000.0,
    "drop_path": 0.55,
    "dropout": 0.1,
}
# The keys whose values cannot be derived from the shapes of the weights.
FREE_KEYS = tuple("heads clip_heads dec_heads clip_quick_gelu ief_iterations focal_px drop_path dropout".split())

# The size of CLIP's text tower. The official state dict has it, but the network does not use it.
OFFICIAL_TEXT = {"width": 512, "layers": 12, "tokens": 77, "vocabulary": 49408}

CLIP = "bioclip_embedding.species_model."

# Groups of tensors. Only the network's are required. The text tower is never used.
NETWORK, TEXT, DISCRIMINATOR, PRIORS, BODY, FLAG = "network", "text tower", "discriminator", "priors", "body", "flag"


@dataclass(frozen=True)
class Expected:
    shape: tuple[int, ...]
    group: str
    dtype: str = "F32"


def config_from_shapes(shapes: Mapping[str, tuple[int, ...]]) -> dict:
    """Returns the official config, with the sizes replaced by those that the shapes of the weights give.

    Where a weight is missing or has too few axes, the paper's size stays. The comparison with expected_tensors() then
    reports that weight.
    """
    config = dict(OFFICIAL_CONFIG)
    _take(config, "embed_dim", shapes, "backbone.pos_embed", 2)
    _take(config, "mlp_ratio", shapes, "backbone.blocks.0.mlp.fc1.weight", 0, config["embed_dim"])
    _take(config, "clip_width", shapes, CLIP + "visual.class_embedding", 0)
    _take(config, "clip_out", shapes, CLIP + "visual.proj", 1)
    _take(config, "dec_dim", shapes, "smal_head.keypoint_2d_embeddings.weight", 1)
    _take(config, "dec_ffn", shapes, "smal_head.layers.0.ffn.0.weight", 0)
    config["depth"] = _count_blocks(shapes, "backbone.blocks.") or config["depth"]
    config["clip_layers"] = _count_blocks(shapes, CLIP + "visual.transformer.resblocks.") or config["clip_layers"]
    config["dec_layers"] = _count_blocks(shapes, "smal_head.layers.") or config["dec_layers"]
    return config


def text_from_shapes(shapes: Mapping[str, tuple[int, ...]]) -> dict:
    """Does the same for the size of CLIP's text tower."""
    text = dict(OFFICIAL_TEXT)
    _take(text, "width", shapes, CLIP + "token_embedding.weight", 1)
    _take(text, "vocabulary", shapes, CLIP + "token_embedding.weight", 0)
    _take(text, "tokens", shapes, CLIP + "positional_embedding", 0)
    text["layers"] = _count_blocks(shapes, CLIP + "transformer.resblocks.") or text["layers"]
    return text


def _take(sizes: dict, key: str, shapes: Mapping[str, tuple[int, ...]], name: str, axis: int, divisor: int = 1):
    shape = shapes.get(name, ())
    if len(shape) > axis and shape[axis] >= divisor:
        sizes[key] = shape[axis] // divisor


def _count_blocks(names: Iterable[str], prefix: str) -> int:
    """Returns the highest index after `prefix`, plus one. An index above the number of names is ignored: it cannot be
    the index of a block."""
    names = list(names)
    pattern = re.compile(re.escape(prefix) + r"(\d{1,6})\.", re.ASCII)
    indices = [int(found[1]) for found in map(pattern.match, names) if found]
    return max((index + 1 for index in indices if index < len(names)), default=0)


def expected_tensors(config: Mapping, text: Mapping = OFFICIAL_TEXT) -> dict[str, Expected]:
    """Returns every tensor of the official state dict for a network of this size, in the official order."""
    table: dict[str, Expected] = {"initialized": Expected((), FLAG, "BOOL")}
    table.update(_named(NETWORK, "backbone.", _backbone(config)))
    table.update(_named(NETWORK, "smal_head.", _head(config)))
    table.update(_named(BODY, "smal.", _body()))
    table.update({name: Expected(item.shape, BODY, "I32") for name, item in table.items() if name in _BODY_INDICES})
    table.update(_named(TEXT, CLIP, _text_parameters(text, config["clip_out"])))
    table.update(_named(NETWORK, CLIP + "visual.", _clip_visual(config)))
    table.update(_named(TEXT, CLIP, _text_tower(text)))
    table.update(_named(NETWORK, "bioclip_embedding.", _projection(config)))
    table.update(_named(DISCRIMINATOR, "discriminator.", _discriminator()))
    table.update(_named(PRIORS, "", _priors()))
    return table


_BODY_INDICES = ("smal.faces", "smal.parents")


def _named(group: str, prefix: str, shapes: Iterable[tuple[str, tuple[int, ...]]]) -> dict[str, Expected]:
    return {prefix + name: Expected(shape, group) for name, shape in shapes}


def _linear(name: str, inputs: int, outputs: int):
    yield f"{name}.weight", (outputs, inputs)
    yield f"{name}.bias", (outputs,)


def _norm(name: str, width: int):
    yield f"{name}.weight", (width,)
    yield f"{name}.bias", (width,)


def _mlp(name: str, inputs: int, hidden: int, outputs: int, second: int = 2):
    """Two linear layers of a torch Sequential, at the indices 0 and `second`."""
    yield from _linear(f"{name}.0", inputs, hidden)
    yield from _linear(f"{name}.{second}", hidden, outputs)


def _attention(name: str, width: int):
    yield f"{name}.in_proj_weight", (3 * width, width)
    yield f"{name}.in_proj_bias", (3 * width,)
    yield from _linear(f"{name}.out_proj", width, width)


def _backbone(config: Mapping):
    width = config["embed_dim"]
    hidden = width * config["mlp_ratio"]
    yield "pos_embed", (1, IMAGE_TOKENS + 1, width)
    yield "cls_token", (1, 1, width)
    yield "patch_embed.proj.weight", (width, 3, PATCH_PX, PATCH_PX)
    yield "patch_embed.proj.bias", (width,)
    for i in range(config["depth"]):
        block = f"blocks.{i}"
        yield from _norm(f"{block}.norm1", width)
        yield from _linear(f"{block}.attn.qkv", width, 3 * width)
        yield from _linear(f"{block}.attn.proj", width, width)
        yield from _norm(f"{block}.norm2", width)
        yield from _linear(f"{block}.mlp.fc1", width, hidden)
        yield from _linear(f"{block}.mlp.fc2", hidden, width)
    yield from _norm("last_norm", width)


def _head(config: Mapping):
    width, features = config["dec_dim"], config["embed_dim"]
    yield "init_pose", (1, POSE_6D)
    yield "init_cam", (1, CAMERA)
    yield from _mlp("bio_to_betas_init", features, 256, BETAS)
    yield from _mlp("shape_projector", BETAS, 128, 128)
    yield from _linear("param_to_token.0", POSE_6D + BETAS + CAMERA, width)
    yield from _norm("param_to_token.1", width)
    yield "keypoint_2d_embeddings.weight", (KEYPOINTS, width)
    yield from _mlp("keypoint_2d_pos_encoder", 2, 256, width)
    yield from _linear("keypoint_2d_feat_linear", width, width)
    yield "keypoint_3d_embeddings.weight", (KEYPOINTS, width)
    yield from _mlp("keypoint_3d_pos_encoder", 3, 256, width)
    yield from _mlp("kp2d_from_tokens", width, width, 2)
    yield from _mlp("kp3d_from_tokens", width, width, 3)
    if features != width:
        yield from _linear("image_proj", features, width)
    for i in range(config["dec_layers"]):
        layer = f"layers.{i}"
        yield from _attention(f"{layer}.self_attn", width)
        yield from _norm(f"{layer}.norm1", width)
        yield from _attention(f"{layer}.cross_attn", width)
        yield from _norm(f"{layer}.norm2", width)
        yield from _mlp(f"{layer}.ffn", width, config["dec_ffn"], width, second=3)
        yield from _norm(f"{layer}.norm3", width)
    yield from _norm("norm", width)
    yield from _mlp("decpose", width, width, POSE_6D)
    yield from _mlp("decshape", width, width, BETAS)
    yield from _mlp("deccam", width, width // 2, CAMERA)


def _body():
    yield "shapedirs", (VERTICES, 3, BETAS)
    yield "v_template", (VERTICES, 3)
    yield "posedirs", (9 * (JOINTS - 1), 3 * VERTICES)
    yield "J_regressor", (JOINTS, VERTICES)
    yield "lbs_weights", (VERTICES, JOINTS)
    yield "faces", (FACES, 3)
    yield "parents", (JOINTS,)


def _clip_block(name: str, width: int):
    yield from _norm(f"{name}.ln_1", width)
    yield from _attention(f"{name}.attn", width)
    yield from _norm(f"{name}.ln_2", width)
    yield from _linear(f"{name}.mlp.c_fc", width, 4 * width)
    yield from _linear(f"{name}.mlp.c_proj", 4 * width, width)


def _clip_visual(config: Mapping):
    width = config["clip_width"]
    yield "class_embedding", (width,)
    yield "positional_embedding", (CLIP_TOKENS + 1, width)
    yield "proj", (width, config["clip_out"])
    yield "conv1.weight", (width, 3, PATCH_PX, PATCH_PX)
    yield from _norm("ln_pre", width)
    for i in range(config["clip_layers"]):
        yield from _clip_block(f"transformer.resblocks.{i}", width)
    yield from _norm("ln_post", width)


def _text_parameters(text: Mapping, outputs: int):
    yield "positional_embedding", (text["tokens"], text["width"])
    yield "text_projection", (text["width"], outputs)
    yield "logit_scale", ()


def _text_tower(text: Mapping):
    for i in range(text["layers"]):
        yield from _clip_block(f"transformer.resblocks.{i}", text["width"])
    yield "token_embedding.weight", (text["vocabulary"], text["width"])
    yield from _norm("ln_final", text["width"])


def _projection(config: Mapping):
    yield from _linear("projection.0", config["clip_out"], config["embed_dim"])
    yield from _norm("projection.1", config["embed_dim"])


def _discriminator():
    yield "D_conv1.weight", (32, 9, 1, 1)
    yield "D_conv1.bias", (32,)
    yield "D_conv2.weight", (32, 32, 1, 1)
    yield "D_conv2.bias", (32,)
    for joint in range(JOINTS - 1):
        yield from _linear(f"pose_out.{joint}", 32, 1)
    yield from _linear("betas_fc1", BETAS, 10)
    yield from _linear("betas_fc2", 10, 5)
    yield from _linear("betas_out", 5, 1)
    yield from _linear("bone_fc1", 24, 10)
    yield from _linear("bone_fc2", 10, 5)
    yield from _linear("bone_out", 5, 1)
    yield from _linear("D_alljoints_fc1", 32 * (JOINTS - 1), 1024)
    yield from _linear("D_alljoints_fc2", 1024, 1024)
    yield from _linear("D_alljoints_out", 1024, 1)


def _priors():
    yield "shape_prior_loss.betas_prec", (FAMILIES, BETAS, BETAS)
    yield "shape_prior_loss.mean_betas", (FAMILIES, BETAS)
    yield "pose_prior_loss.mean_pose", (3 * JOINTS,)
    yield "pose_prior_loss.precs", (3 * JOINTS, 3 * JOINTS)
    yield "pose_prior_loss.use_index", (3 * JOINTS,)
