"""The small job that most tests begin with."""

import json

from .case import Case
from .datasets import build_digests, latest
from .pictures import draw_pictures, make_network, prima_dataset, write_annotations, write_json
from .program import run

PICTURES = 24
UNIT = 6  # candidates


class Scene:
    """A dataset of drawn pictures, a tiny network, a config and calibrated thresholds.

    `root` holds them; Scene.make() writes them. Configs and output folders of a test go into `folder`.
    """

    def __init__(self, root, folder=None):
        self.root = root
        self.folder = folder or root
        self.data = root / "data"
        self.network = root / "tiny.safetensors"
        self.body = root / "smal.safetensors"
        self.config = root / "config.json"
        self.thresholds = root / "thresholds.json"

    @classmethod
    def make(cls, root):
        """Writes the files of a scene and returns it."""
        scene = cls(root)
        write_annotations(scene.data, draw_pictures(scene.data, PICTURES))
        make_network(scene.network, seed=3, body=scene.body)
        scene.write_config("config.json")
        run("calibrate", "--config", scene.config, "--out", root / "calibration", "--write", scene.thresholds)
        return scene

    def in_folder(self, folder):
        """The same scene for one test, whose configs and output folders go into `folder`."""
        return Scene(self.root, folder)

    @property
    def records(self):
        """The annotations, as the file has them."""
        return json.loads((self.data / "train.json").read_text())["data"]

    @property
    def limits(self):
        """The calibrated thresholds: tau_low, tau_high, delta."""
        return json.loads(self.thresholds.read_text())["filter"]

    def write_config(self, name, **changes):
        """Writes the scene's config with changes: an object's members are replaced one by one, all else as a whole."""
        config = {
            "name": "drawn", "version": "1.0.0", "datasets": [prima_dataset(self.data)],
            "network": {"checkpoint": str(self.network), "smal_asset": str(self.body), "device": "cpu", "batch": 4,
                        "compute_threads": 1},
            "tta": {"learning_rate": 1e-3, "batch": 4},
            "filter": {"tau_ceiling": 1.0},  # the network is untrained, and the pictures are noise
            "shards": {"unit_size": UNIT},
        }
        for key, value in changes.items():
            config[key] = {**config[key], **value} if isinstance(config.get(key), dict) else value
        return write_json(self.folder / name, config)

    def build_words(self, out, *more, config=None):
        """Arguments of a build into folder/out."""
        return ["build", "--config", config or self.config, "--config", self.thresholds, "--out", self.folder / out,
                *more]

    def build(self, out, *more, config=None, **options):
        """Builds into folder/out. `options` go to run()."""
        return run(*self.build_words(out, *more, config=config), **options)

    def build_in_small_units(self, out):
        """Builds into folder/out by the config fine.json, which it writes, in units of two candidates."""
        return self.build(out, config=self.write_config("fine.json", shards={"unit_size": 2}))

    def latest(self, out):
        """The newest dataset in folder/out."""
        return latest(self.folder / out)


class SceneCase(Case):
    """Tests that share a scene, each with output folders of its own."""

    @classmethod
    def prepare(cls):
        Scene.make(cls.shared)

    def setUp(self):
        super().setUp()
        self.scene = Scene(self.shared, self.folder)


class SmallUnitsCase(SceneCase):
    """Tests that share a scene, and compare a build in small units with what one process has made in shared/one."""

    @classmethod
    def prepare(cls):
        Scene.make(cls.shared).build_in_small_units("one")

    def setUp(self):
        super().setUp()
        self.config = self.shared / "fine.json"

    def assert_equals_one(self, out="out"):
        self.assertEqual(build_digests(self.folder / out), build_digests(self.shared / "one"))


class DrawnCase(Case):
    """Tests that share three drawn pictures with keypoints, and a finished dataset of them."""

    @classmethod
    def prepare(cls):
        write_annotations(cls.shared / "data", draw_pictures(cls.shared / "data", 3))
        write_json(cls.shared / "config.json",
                   {"name": "drawn", "datasets": [prima_dataset(cls.shared / "data", role="2d_only")]})
        run("build", "--config", cls.shared / "config.json", "--out", cls.shared / "out")
