"""tools/detect_keypoints.py with a stand-in for DeepLabCut 3 that has its signature and gives arrays of its form.

The form is that of DeepLabCut's superanimal_analyze_images for a detector of boxes followed by a pose network: for each
path `bodyparts` (animals, keypoints, 3), `bboxes` (animals, 4; x, y, width, height) and `bbox_scores`, all of them filled
up to the largest number of animals with -1.
"""

import contextlib
import io
import json
import pathlib
import sys
import tempfile
import types
import unittest
from unittest import mock

import numpy as np
from PIL import Image

import support  # first of ours: it sets the path
import detect_keypoints

MOST = 3  # animals in a picture


def body(keypoints, x, y):
    """A body of which every point has another place and another confidence, rising from 0.3 to 0.9."""
    numbers = np.arange(keypoints)
    return np.stack([x + numbers, y + 2 * numbers, np.linspace(0.3, 0.9, keypoints)], axis=1).astype(np.float32)


def padded(rows, tail):
    """As DeepLabCut's PadOutputs does it: float64, filled up with -1."""
    rows = np.asarray(rows, np.float32).reshape(-1, *tail)
    return np.concatenate([rows, -np.ones((MOST - len(rows), *tail))])


def prediction(bodies, boxes, scores, keypoints):
    return {"bodyparts": padded(bodies, (keypoints, 3)), "bboxes": padded(boxes, (4,)), "bbox_scores": padded(scores, ())}


class DeepLabCut:
    """Stands for the package; `calls` has the keyword arguments of each call."""

    def __init__(self, keypoints, by_name):
        self.keypoints, self.by_name, self.calls = keypoints, by_name, []

    def superanimal_analyze_images(
        self, superanimal_name, model_name, detector_name, images, max_individuals, out_folder, progress_bar=True,
        device=None, pose_threshold=0.4, bbox_threshold=0.6, plot_skeleton=True, customized_model_config=None,
        customized_pose_checkpoint=None, customized_detector_checkpoint=None,
    ):  # fmt: skip
        self.calls.append({key: value for key, value in locals().items() if key != "self"})
        nothing = prediction([], [], [], self.keypoints)
        return {path: self.by_name.get(pathlib.Path(path).name, nothing) for path in images}

    @contextlib.contextmanager
    def installed(self):
        apis = types.ModuleType("deeplabcut.pose_estimation_pytorch.apis")
        apis.superanimal_analyze_images = self.superanimal_analyze_images
        names = ("deeplabcut", "deeplabcut.pose_estimation_pytorch", apis.__name__)
        with mock.patch.dict(sys.modules, {names[0]: types.ModuleType(names[0]), names[1]: types.ModuleType(names[1]),
                                           names[2]: apis}):
            yield self


class DetectKeypoints(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.home = pathlib.Path(folder.name)
        self.photos = self.home / "photos"
        (self.photos / "day2").mkdir(parents=True)
        for name, size in (("b.png", (200, 100)), ("day2/a.jpg", (80, 60)), ("empty.png", (50, 50))):
            Image.new("RGB", size).save(self.photos / name)
        (self.photos / "notes.txt").write_text("no picture")
        self.out = self.home / "labels.json"

    def found(self, keypoints):
        """Two animals in b.png, whose second box ends outside, one in a.jpg, none in empty.png."""
        return DeepLabCut(keypoints, {
            "b.png": prediction([body(keypoints, 5, 6), body(keypoints, 100, 10)],
                                [[5, 6, 50, 80], [150, -4, 90, 60.5]], [0.99, 0.7], keypoints),
            "a.jpg": prediction([body(keypoints, 1, 2)], [[0, 0, 40, 50]], [0.8], keypoints),
        })  # fmt: skip

    def run_tool(self, *words, expect=0):
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                code = detect_keypoints.main([str(self.photos), "--out", str(self.out), *map(str, words)])
            except SystemExit as exit:
                code = exit.code
        self.assertEqual(code, expect, err.getvalue())
        return out.getvalue(), err.getvalue()

    def test_the_39_of_superanimal(self):
        with self.found(39).installed() as deeplabcut:
            out, _ = self.run_tool("--most-animals", MOST, "--min-box-score", 0.5, "--device", "cpu")
        self.assertIn('3 animals in 3 photographs; "topology": "superanimal_quadruped"', out)
        call, = deeplabcut.calls
        self.assertEqual((call["superanimal_name"], call["max_individuals"], call["bbox_threshold"], call["device"]),
                         ("superanimal_quadruped", MOST, 0.5, "cpu"))
        self.assertIsNone(call["customized_pose_checkpoint"])
        labels = json.loads(self.out.read_text())
        self.assertEqual([(image["file_name"], image["width"], image["height"]) for image in labels["images"]],
                         [("b.png", 200, 100), ("day2/a.jpg", 80, 60), ("empty.png", 50, 50)])
        topology = json.loads((pathlib.Path(support.ROOT) / "configs/topologies/superanimal_quadruped.json").read_text())
        self.assertEqual(labels["categories"][0]["keypoints"], topology["keypoints"])
        first, second, third = labels["annotations"]
        self.assertEqual((first["image_id"], second["image_id"], third["image_id"]), (1, 1, 2))
        self.assertEqual((first["bbox"], second["bbox"]), ([5, 6, 50, 80], [150, 0, 50, 56.5]))  # cut at the border
        self.assertEqual((first["score"], second["score"]), (0.99, 0.7))
        np.testing.assert_allclose(np.reshape(second["keypoints"], (39, 3)), body(39, 100, 10), atol=1e-4)

    def test_the_26_of_prima(self):
        with self.found(26).installed() as deeplabcut:
            self.run_tool("--weights", "w.pt", "--config", "c.yaml")
        call, = deeplabcut.calls
        self.assertEqual((call["customized_pose_checkpoint"], call["customized_model_config"]), ("w.pt", "c.yaml"))
        labels = json.loads(self.out.read_text())
        # The network's order is Animal3D's; its config swaps the names of the tail's tip and middle.
        names = labels["categories"][0]["keypoints"]
        self.assertEqual((len(names), names[0], names[19], names[25]), (26, "left_eye", "tail_tip", "tail_mid"))

    def test_saved_predictions_give_the_same_file(self):
        saved = self.home / "predictions.json"
        with self.found(39).installed():
            self.run_tool("--save-predictions", saved)
        labels = self.out.read_text()
        self.out.unlink()
        self.run_tool("--predictions", saved, "--keypoints", 39)
        self.assertEqual(self.out.read_text(), labels)

    def test_a_point_without_confidence_is_no_label(self):
        points = body(39, 1, 2)
        points[4, 2], points[5, 0], points[6, 2] = 0, np.nan, 1.2
        with DeepLabCut(39, {"b.png": prediction([points], [[0, 0, 9, 9]], [0.9], 39)}).installed():
            self.run_tool()
        entry, = json.loads(self.out.read_text())["annotations"]
        triples = np.reshape(entry["keypoints"], (39, 3))
        self.assertEqual((triples[4].tolist(), triples[5].tolist(), triples[6, 2]), ([0, 0, 0], [0, 0, 0], 1))
        self.assertEqual(entry["num_keypoints"], 37)

    def test_pictures_are_seen_upright(self):
        exif = Image.Exif()
        exif[detect_keypoints.ORIENTATION] = 6  # a quarter turn
        Image.new("RGB", (80, 60)).save(self.photos / "day2/a.jpg", exif=exif)
        with self.found(39).installed():
            out, _ = self.run_tool()
        image = json.loads(self.out.read_text())["images"][1]
        self.assertEqual((image["width"], image["height"]), (60, 80))
        self.assertIn('1 photographs have an EXIF orientation', out)

    def test_another_form_is_refused_and_nothing_is_written(self):
        with self.found(26).installed():  # the 26 where the 39 are expected
            _, err = self.run_tool(expect=1)
        self.assertIn("b.png: bodyparts: got (3, 26, 3), expected (animals, 39, 3)", err)
        self.assertFalse(self.out.exists())

    def test_without_deeplabcut(self):
        with mock.patch.dict(sys.modules, {"deeplabcut": None}):
            _, err = self.run_tool(expect=2)
        self.assertIn("pip install --pre deeplabcut", err)

    def test_wrong_usage(self):
        for words, message in ((["--weights", "w.pt"], "belong together"), (["--keypoints", 26], "--predictions needs"),
                               (["--predictions", "p.json"], "--predictions needs")):
            self.assertIn(message, self.run_tool(*words, expect=2)[1])


if __name__ == "__main__":
    unittest.main()
