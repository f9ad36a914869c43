"""Tests the import of the Lightning checkpoint, BioCLIP and AniMer's backbone, on tiny files of the official form.

The official code created the network's tensors and their names (tests/data/parity/weights_A).
"""

import enum
import json
import os
import pathlib
import tempfile
import unittest

import numpy as np
import support  # first of ours: it sets the path
import prima_names
import safetensors_file
import torch

TINY = {"embed_dim": 64, "depth": 2, "clip_width": 64, "clip_layers": 2, "clip_out": 32}
TINY |= {"dec_dim": 64, "dec_layers": 2, "dec_ffn": 256, "mlp_ratio": 4}
HEADS = ("--set", "heads=4", "--set", "clip_heads=4", "--set", "dec_heads=4")
TEXT = {"width": 8, "layers": 1, "tokens": 5, "vocabulary": 11}
CLIP = "bioclip_embedding.species_model."


class Mode(enum.Enum):
    JOINT = "joint"


def network():
    tensors, _ = support.read_safetensors(os.path.join(support.PARITY, "weights_A.safetensors"))
    prefixes = ("backbone.", "smal_head.", "bioclip_embedding.")
    return {
        name: torch.from_numpy(values.astype(np.float32))
        for name, values in tensors.items()
        if name.startswith(prefixes)
    }


def extras():
    """Returns random tensors for everything that the official state dict holds besides the network."""
    expected = prima_names.expected_tensors(prima_names.OFFICIAL_CONFIG | TINY, TEXT)
    generator = torch.Generator().manual_seed(5)
    types = {"F32": torch.float32, "I32": torch.int32, "BOOL": torch.bool}
    return {
        name: (torch.rand(item.shape, generator=generator) * 100).to(types[item.dtype])
        for name, item in expected.items()
        if item.group != prima_names.NETWORK
    }


def lightning(state_dict, hyper_parameters=None):
    """Returns a checkpoint with the entries that Lightning's trainer writes besides the weights."""
    parameter = next(iter(state_dict.values()))
    return {
        "epoch": 3,
        "global_step": 1200,
        "pytorch-lightning_version": "2.4.0",
        "state_dict": state_dict,
        "loops": {"fit_loop": {"state_dict": {}, "epoch_progress": {"total": {"ready": 4}}}},
        "callbacks": {"ModelCheckpoint{'monitor': None}": {"best_model_score": torch.tensor(0.5)}},
        "optimizer_states": [{"state": {0: {"step": torch.tensor(9.0), "exp_avg": parameter * 2}}, "param_groups": []}],
        "lr_schedulers": [],
        "hparams_name": "kwargs",
        "hyper_parameters": hyper_parameters,
    }


class CheckpointCase(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.network = network()
        cls.extras = extras()

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.source, self.target = self.folder / "in.ckpt", self.folder / "out.safetensors"

    def save(self, state_dict, hyper_parameters=None):
        torch.save(lightning(state_dict, hyper_parameters), self.source)

    def convert(self, *options, heads=HEADS):
        return support.run("checkpoint", self.source, self.target, *heads, *options)

    def assert_fails(self, result, *mentions, code=1):
        self.assertEqual((result[0], result[1]), (code, ""))
        for mention in mentions:
            self.assertIn(mention, result[2])

    def config(self):
        return json.loads(support.read_safetensors(self.target)[1]["prima_config"])


class ImportTest(CheckpointCase):
    def test_every_tensor_arrives_unchanged(self):
        self.save(self.network | self.extras)
        code, out, err = self.convert()
        self.assertEqual((code, err), (0, ""))
        tensors, metadata = support.read_safetensors(self.target)
        text = {name for name in self.extras if name.startswith(CLIP)}
        wanted = {name: tensor for name, tensor in (self.network | self.extras).items() if name not in text}
        self.assertEqual(set(tensors), set(wanted))
        for name, tensor in wanted.items():
            np.testing.assert_array_equal(tensors[name], tensor.numpy(), err_msg=name)
            self.assertEqual(tensors[name].dtype, tensor.numpy().dtype)
        self.assertIn(f"{len(wanted)} of {len(wanted) + len(text)} tensors", out)
        self.assertIn(f"left out: {len(text)} of CLIP's text tower", out)
        self.assertEqual(metadata["imported_from"], "in.ckpt")
        self.assertEqual(json.loads(metadata["prima_domain"])["pictures"], "photographs")
        config = json.loads(metadata["prima_config"])
        self.assertEqual({key: config[key] for key in TINY}, TINY)
        self.assertEqual([config[key] for key in ("heads", "clip_heads", "dec_heads")], [4, 4, 4])
        self.assertEqual(set(config), set(prima_names.OFFICIAL_CONFIG))

    def test_the_same_file_gives_the_same_bytes(self):
        self.save(self.network)
        self.assertEqual(self.convert()[0], 0)
        first = self.target.read_bytes()
        self.assertEqual(self.convert()[0], 0)
        self.assertEqual(self.target.read_bytes(), first)
        self.assertEqual(sorted(os.listdir(self.folder)), ["in.ckpt", "out.safetensors"])

    def test_the_text_tower_on_request(self):
        self.save(self.network | self.extras)
        self.assertEqual(self.convert("--keep-text")[0], 0)
        self.assertEqual(len(support.read_safetensors(self.target)[0]), len(self.network | self.extras))

    def test_the_network_alone_is_enough(self):
        self.save(self.network)
        code, out, _ = self.convert()
        self.assertEqual(code, 0)
        self.assertIn("not needed to predict: body, discriminator, flag, priors", out)

    def test_a_bare_state_dict_and_half_precision(self):
        for dtype in (torch.float16, torch.bfloat16):
            torch.save({name: tensor.to(dtype) for name, tensor in self.network.items()}, self.source)
            self.assertEqual(self.convert()[0], 0)
            tensors, _ = support.read_safetensors(self.target)
            for name, tensor in self.network.items():
                half = tensor.to(dtype).view(torch.uint16).numpy()
                np.testing.assert_array_equal(tensors[name].view(np.uint16), half, err_msg=name)

    def test_a_decoder_of_another_width_than_the_backbone(self):
        config = prima_names.OFFICIAL_CONFIG | {"embed_dim": 8, "depth": 1, "mlp_ratio": 2, "clip_width": 4}
        config |= {"clip_layers": 3, "clip_out": 5, "dec_dim": 12, "dec_layers": 2, "dec_ffn": 7}
        expected = prima_names.expected_tensors(config)
        self.save({name: torch.zeros(item.shape) for name, item in expected.items() if item.group == "network"})
        code, _, err = self.convert()
        self.assertEqual((code, err), (0, ""))
        self.assertIn("smal_head.image_proj.weight", support.read_safetensors(self.target)[0])
        self.assertEqual({key: self.config()[key] for key in TINY}, {key: config[key] for key in TINY})


class OfficialNamesTest(unittest.TestCase):
    def test_the_955_tensors(self):
        with open(os.path.join(support.ROOT, "tests", "data", "official_state_dict.json"), encoding="utf-8") as file:
            official = json.load(file)
        expected = prima_names.expected_tensors(prima_names.OFFICIAL_CONFIG)
        types = {"float32": "F32", "int32": "I32", "bool": "BOOL"}
        self.assertEqual(len(official), 955)
        self.assertEqual(
            [(name, list(item.shape), item.dtype) for name, item in expected.items()],
            [(name, entry["shape"], types[entry["dtype"]]) for name, entry in official.items()],
        )
        shapes = {name: tuple(entry["shape"]) for name, entry in official.items()}
        self.assertEqual(prima_names.config_from_shapes(shapes), prima_names.OFFICIAL_CONFIG)


class HyperparameterTest(CheckpointCase):
    def settings(self, cfg):
        return {"MODEL": {"SMAL_HEAD": {"IEF_ITERS": 3, "NUM_HEADS": 4}}, "SMAL": {"FOCAL_LENGTH": 700}} if cfg else {}

    def check(self):
        code, out, err = self.convert(heads=HEADS[:4])
        self.assertEqual((code, err), (0, ""))
        config = self.config()
        self.assertEqual((config["ief_iterations"], config["dec_heads"], config["focal_px"]), (3, 4, 700.0))
        self.assertIn("ief_iterations=3 (the file's hyperparameters)", out)
        self.assertIn("heads=4 (given)", out)

    def test_yacs_nodes(self):
        with support.foreign_classes(("yacs.config.CfgNode", dict)) as made:

            def node(tree):
                if not isinstance(tree, dict):
                    return tree
                made_node = made.CfgNode({key: node(value) for key, value in tree.items()})
                made_node.__dict__.update(_immutable=True, _mode=Mode.JOINT, _where=pathlib.PosixPath("/runs/1"))
                return made_node

            self.save(self.network, {"cfg": node(self.settings(True))})
        self.check()

    def test_omegaconf_nodes(self):
        with support.foreign_classes(
            ("omegaconf.dictconfig.DictConfig", object),
            ("omegaconf.nodes.AnyNode", object),
            ("omegaconf.base.ContainerMetadata", object),
        ) as made:

            def node(tree, parent=None):
                made_node = made.DictConfig() if isinstance(tree, dict) else made.AnyNode()
                made_node._parent, made_node._metadata = parent, made.ContainerMetadata()
                made_node._metadata.ref_type = dict
                if isinstance(tree, dict):
                    made_node._content = {key: node(value, made_node) for key, value in tree.items()}
                else:
                    made_node._val = tree
                return made_node

            self.save(self.network, {"cfg": node(self.settings(True))})
        self.check()

    def test_given_settings_win_and_are_checked(self):
        self.save(self.network, {"cfg": self.settings(True)})
        config = self.folder / "config.json"
        config.write_text('{"ief_iterations": 2, "clip_quick_gelu": true, "embed_dim": 64}')
        self.assertEqual(self.convert("--config", config, "--set", "focal_px=900")[0], 0)
        got = self.config()
        self.assertEqual((got["ief_iterations"], got["clip_quick_gelu"], got["focal_px"]), (2, True, 900))
        for setting, mention in (
            ("ief=3", "unknown config key 'ief'"),
            ("depth=3", "the weights' shapes say 2"),
            ("heads=5", "'heads' = 5 (given) does not divide 'embed_dim' = 64"),
            ("heads=0", "does not divide"),
            ("heads=4.0", "expected a value like 16"),
            ("heads=true", "expected a value like 16"),
            ("clip_quick_gelu=1", "expected a value like"),
        ):
            with self.subTest(setting=setting):
                self.target.unlink(missing_ok=True)
                self.assert_fails(self.convert("--set", setting), mention)
                self.assertFalse(self.target.exists())
        config.write_text("[1]")
        self.assert_fails(self.convert("--config", config), "config.json: not a JSON object")


class FaultTest(CheckpointCase):
    def test_all_faults_in_one_message(self):
        state = self.network | self.extras
        state["backbone.blocks.1.attn.qkv.weight"] = torch.zeros(192, 63)
        state["smal_head.norm.bias"] = state["smal_head.norm.bias"].double()
        state["smal.parents"] = state["smal.parents"].long()
        state["smal_head.surprise"] = torch.zeros(2, 3)
        state["backbone.blocks.7x.norm1.weight"] = torch.zeros(1)
        for name in ("backbone.blocks.0.norm1.bias", CLIP + "visual.proj", "discriminator.bone_out.bias"):
            del state[name]
        self.save(state)
        self.target.write_bytes(b"before")
        self.assert_fails(
            self.convert(),
            "in.ckpt: 10 tensors do not fit the network",
            "backbone.blocks.1.attn.qkv.weight: shape [192, 63], expected [192, 64]",
            "smal_head.norm.bias: dtype F64, expected F32 or F16 or BF16",
            "smal.parents: dtype I64, expected I32",
            "smal_head.surprise: extra, F32 [2, 3]",
            "backbone.blocks.7x.norm1.weight: extra",
            "backbone.blocks.0.norm1.bias: missing, expected F32 [64]",
            CLIP + "visual.proj: missing",
            # 512 is the default, since visual.proj is missing.
            "bioclip_embedding.projection.0.weight: shape [64, 32], expected [64, 512]",
            CLIP + "text_projection: shape [8, 32], expected [8, 512]",
            "discriminator.bone_out.bias: missing",
            "--drop PREFIX",
        )
        self.assertEqual(self.target.read_bytes(), b"before")
        self.assertEqual(sorted(os.listdir(self.folder)), ["in.ckpt", "out.safetensors"])

    def test_unknown_tensors_can_be_dropped_by_name(self):
        self.save(self.network | {"ema.weight": torch.zeros(1), "ema.bias": torch.zeros(1)})
        self.assert_fails(self.convert(), "ema.weight: extra", "ema.bias: extra")
        code, out, _ = self.convert("--drop", "ema.")
        self.assertEqual(code, 0)
        self.assertIn("left out by --drop: ema.weight, ema.bias", out)
        self.assertEqual(set(support.read_safetensors(self.target)[0]), set(self.network))

    def test_files_that_cannot_be_read_or_written(self):
        self.assert_fails(self.convert(), "in.ckpt: No such file or directory")
        self.save(self.network)
        result = support.run("checkpoint", self.source, self.folder / "no" / "out.safetensors", *HEADS)
        self.assert_fails(result, "No such file or directory")
        torch.save({"state_dict": [1]}, self.source)
        self.assert_fails(self.convert(), "state_dict is a list, expected a table of tensors")
        torch.save({"epoch": 3}, self.source)
        self.assert_fails(self.convert(), "epoch: a int, expected a tensor")

    def test_a_failure_while_writing_leaves_nothing(self):
        def chunks():
            yield b"\0" * 4
            raise OSError(28, "No space left on device")

        self.target.write_bytes(b"before")
        with self.assertRaises(OSError):
            safetensors_file.write(str(self.target), {"a": safetensors_file.Tensor("F32", (2,), chunks)}, {})
        self.assertEqual((self.target.read_bytes(), os.listdir(self.folder)), (b"before", ["out.safetensors"]))

    def test_usage(self):
        self.assert_fails(support.run(), "usage", code=2)
        self.assert_fails(support.run("checkpoint", "a"), "the following arguments are required: OUT", code=2)
        self.assert_fails(support.run("checkpoint", "a", "b", "--set", "heads"), "KEY=VALUE", code=2)
        for command in ("checkpoint", "smal", "priors", "bioclip", "backbone", "fetch"):
            code, out, _ = support.run(command, "--help")
            self.assertEqual(code, 0)
            self.assertIn(f"import_assets.py {command}", out)


class MergeTest(CheckpointCase):
    def setUp(self):
        super().setUp()
        self.base = self.folder / "base.safetensors"
        self.save(self.network | {name: tensor for name, tensor in self.extras.items() if "prior_loss" in name})
        self.assertEqual(support.run("checkpoint", self.source, self.base, *HEADS)[0], 0)
        self.before, self.metadata = support.read_safetensors(self.base)
        self.open_clip = self.folder / "open_clip_config.json"
        self.write_config()

    def write_config(self, **changes):
        vision = {"image_size": 224, "layers": 2, "width": 64, "patch_size": 16, "head_width": 8}
        self.open_clip.write_text(json.dumps({"model_cfg": {"embed_dim": 32, "vision_cfg": vision} | changes}))

    def part(self, prefix, strip):
        return {
            name.removeprefix(strip): tensor * 2 + 1 for name, tensor in self.network.items() if name.startswith(prefix)
        }

    def assert_merged(self, prefix, part, strip):
        after, metadata = support.read_safetensors(self.target)
        self.assertEqual(set(after), set(self.before))
        for name, values in after.items():
            expected = part[name.removeprefix(strip)].numpy() if name.startswith(prefix) else self.before[name]
            np.testing.assert_array_equal(values, expected, err_msg=name)
        return json.loads(metadata["prima_config"])

    def test_backbone(self):
        others = {"smal_head.decoder.weight": torch.zeros(3), "class_token_head.bias": torch.zeros(2)}
        for strip in ("", "backbone."):
            part = self.part("backbone.", strip)
            torch.save({"state_dict": part | (others if not strip else {})}, self.source)
            code, out, err = support.run("backbone", self.source, "--into", self.base, self.target)
            self.assertEqual((code, err), (0, ""))
            config = self.assert_merged("backbone.", part, strip)
            self.assertEqual(config, json.loads(self.metadata["prima_config"]))
        del part["last_norm.bias"]
        torch.save(part, self.source)
        self.assert_fails(
            support.run("backbone", self.source, "--into", self.base, self.target),
            "1 tensor does not fit", "backbone.last_norm.bias: missing", "the sizes in",
        )  # fmt: skip

    def bioclip(self):
        return support.run(
            "bioclip", self.source, "--open-clip-config", self.open_clip, "--into", self.base, self.target
        )

    def test_bioclip(self):
        prefix = CLIP + "visual."
        part = self.part(prefix, CLIP)
        others = {"transformer.resblocks.0.ln_1.bias": torch.zeros(3), "logit_scale": torch.tensor(1.0)}
        torch.save(part | others, self.source)
        for quick, changes in ((False, {}), (True, {"quick_gelu": True}), (False, {"quick_gelu": False})):
            self.write_config(**changes)
            code, out, err = self.bioclip()
            self.assertEqual((code, err), (0, ""))
            config = self.assert_merged(prefix, part, CLIP)
            self.assertEqual((config["clip_quick_gelu"], config["clip_heads"]), (quick, 8))
            self.assertIn("not used: 2 other tensors", out)

    def test_bioclip_from_safetensors(self):
        part = self.part(CLIP + "visual.", CLIP)
        entries = {name: safetensors_file.from_array(tensor.numpy()) for name, tensor in part.items()}
        safetensors_file.write(str(self.source), entries, {"format": "pt"})
        self.assertEqual(self.bioclip()[0], 0)
        self.assert_merged(CLIP + "visual.", part, CLIP)

    def test_bioclip_of_another_model(self):
        torch.save(self.part(CLIP + "visual.", CLIP), self.source)
        for changes, mention in (
            ({"quick_gelu": "TRUE"}, "quick_gelu is 'TRUE', expected true or false"),
            ({"embed_dim": 768}, "clip_out is 768, but 32 in the weights"),
            ({"vision_cfg": {}}, "not an open_clip_config.json"),
        ):
            self.write_config(**changes)
            self.assert_fails(self.bioclip(), "open_clip_config.json", mention)
        self.write_config()
        torch.save({name: torch.zeros(1) for name in self.part(CLIP + "visual.", CLIP)}, self.source)
        self.assertEqual(self.bioclip()[0], 1)

    def test_the_open_clip_config_serves_the_checkpoint_too(self):
        self.write_config(quick_gelu=True)
        self.assertEqual(self.convert("--open-clip-config", self.open_clip, heads=HEADS[:2] + HEADS[4:])[0], 0)
        self.assertEqual((self.config()["clip_quick_gelu"], self.config()["clip_heads"]), (True, 8))

    def test_bases_that_do_not_serve(self):
        torch.save(self.part("backbone.", ""), self.source)
        safetensors_file.write(str(self.base), {}, {})
        merge = ("backbone", self.source, "--into", self.base, self.target)
        self.assert_fails(support.run(*merge), "base.safetensors: no usable 'prima_config' in its metadata")
        for config in ("[" * 100_000, "[]", '{"depth": 1000000000}', '{"dec_layers": "6"}', '{"embed_dim": null}'):
            safetensors_file.write(str(self.base), {}, {"prima_config": config})
            self.assert_fails(support.run(*merge), "base.safetensors: no usable 'prima_config' in its metadata")
        whole = b"\x10\0\0\0\0\0\0\0" + b'{"a":{"dtype":1}'
        for content, mention in ((b"", "0 bytes"), (b"\xff" * 64, "a header of"), (whole, "not JSON")):
            self.base.write_bytes(content)
            self.assert_fails(support.run(*merge), "base.safetensors: not a usable safetensors file", mention)

    def test_a_truncated_base(self):
        torch.save(self.part("backbone.", ""), self.source)
        whole = self.base.read_bytes()
        merge = ("backbone", self.source, "--into", self.base, self.target)
        for length in (5, 100, len(whole) // 2, len(whole) - 1):
            self.base.write_bytes(whole[:length])
            self.assert_fails(support.run(*merge), "base.safetensors: not a usable safetensors file")


if __name__ == "__main__":
    unittest.main()
