"""Label files of SLEAP and Lightning Pose, from the file to the shard. h5py writes the HDF5 files here, in the layouts
that sleap-io's documentation gives."""

import json

import h5py
import numpy as np
from PIL import Image

from e2e import Case, latest, read_samples, run, write_json

NODES = ["nose", "eye_l", "eye_r", "tail"]
TOPOLOGY = {"name": "mice4", "keypoints": NODES, "flip_pairs": [["eye_l", "eye_r"]],
            "animal3d26": {"nose": "nose", "left_eye": "eye_l", "right_eye": "eye_r", "tail_base": "tail"}}
PLACES = {"nose": 24, "eye_l": 0, "eye_r": 1, "tail": 7}  # among the 26 of Animal3D
NONE = float("nan")


def animal(x, y):
    """Four points, (4, 2)."""
    return np.array([[x + 30, y + 10], [x + 25, y], [x + 26, y + 20], [x, y + 11]], float)


def metadata(nodes=NODES):
    """The JSON of a .slp with one skeleton. Its nodes point into the list of nodes, as SLEAP writes them."""
    return json.dumps({"version": "2.0.0", "skeletons": [{"nodes": [{"id": i} for i in range(len(nodes))]}],
                       "nodes": [{"name": name, "weight": 1.0} for name in nodes]})


INSTANCE = [("instance_id", "i8"), ("instance_type", "u1"), ("frame_id", "u8"), ("skeleton", "u4"), ("track", "i4"),
            ("from_predicted", "i8"), ("score", "f4"), ("point_id_start", "u8"), ("point_id_end", "u8"),
            ("tracking_score", "f4")]
FRAME = [("frame_id", "u8"), ("video", "u4"), ("frame_idx", "u8"), ("instance_id_start", "u8"), ("instance_id_end", "u8")]
POINT = [("x", "f8"), ("y", "f8"), ("visible", "?"), ("complete", "?")]


class SlpFile:
    """Collects frames of instances, and writes them as a .slp."""

    def __init__(self, tracks=(), video={"backend": {"filename": "clip.mp4"}}, format_id=1.2, videos=1):
        self.tracks, self.format_id = list(tracks), format_id
        self.videos = video if isinstance(video, list) else [video] * videos
        self.frames, self.instances, self.points, self.pred_points = [], [], [], []

    def frame(self, index, animals, video=0):
        """animals: dictionaries with `points` (4, 2), and if they differ `track`, `score`, `made_from`, `hidden`."""
        first = len(self.instances)
        for each in animals:
            predicted = "score" in each
            points = self.pred_points if predicted else self.points
            start = len(points)
            for node, (x, y) in enumerate(each["points"]):
                visible = node not in each.get("hidden", ()) and not np.isnan(x)
                points.append((x, y, visible, True) + ((each["score"],) if predicted else ()))
            self.instances.append((len(self.instances), int(predicted), len(self.frames), 0, each.get("track", -1),
                                   each.get("made_from", -1), each.get("score", 0.0), start, len(points), 0.0))
        self.frames.append((len(self.frames), video, index, first, len(self.instances)))

    def write(self, path, nodes=NODES):
        with h5py.File(path, "w") as file:
            group = file.create_group("metadata")
            group.attrs["format_id"] = self.format_id
            group.attrs["json"] = np.bytes_(metadata(nodes))
            texts = h5py.special_dtype(vlen=bytes)
            file.create_dataset("videos_json", data=[json.dumps(each) for each in self.videos], dtype=texts)
            file.create_dataset("tracks_json", data=[json.dumps([0, name]) for name in self.tracks], dtype=texts,
                                shape=(len(self.tracks),))
            file.create_dataset("frames", data=np.array(self.frames, FRAME))
            file.create_dataset("instances", data=np.array(self.instances, INSTANCE))
            file.create_dataset("points", data=np.array(self.points, POINT))
            file.create_dataset("pred_points", data=np.array(self.pred_points, POINT + [("score", "f8")]))


class ForeignLabels(Case):
    def setUp(self):
        super().setUp()
        write_json(self.folder / "mice.json", TOPOLOGY)
        generator = np.random.default_rng(1)
        for i in range(4):
            path = self.folder / "frames" / f"img{i:03}.png"
            path.parent.mkdir(exist_ok=True)
            Image.fromarray(generator.integers(0, 255, (120, 160, 3), dtype=np.uint8)).save(path)

    def build(self, annotations, form="sleap", expect=0, **more):
        config = {"name": "foreign", "datasets": [{"name": "clip", "format": form, "root": ".", "images": "frames",
                                                   "annotations": annotations, "topology": "mice.json",
                                                   "species": "mouse", "role": "2d_only", **more}]}
        write_json(self.folder / "build.json", config)
        result = run("build", "--config", self.folder / "build.json", "--out", self.folder / "out", expect=expect)
        if expect:
            return result
        return {sample["id"].decode(): sample for sample in read_samples(latest(self.folder / "out"))}

    def assert_points(self, sample, points, hidden=()):
        for node, name in enumerate(NODES):
            weight = sample["keypoints_weight"][PLACES[name]]
            if name in hidden:
                self.assertEqual(weight, 0.0, name)
                continue
            self.assertGreater(weight, 0.0, name)
            np.testing.assert_allclose(sample["keypoints_px"][PLACES[name]], points[node], rtol=1e-6, err_msg=name)

    def test_labels_by_hand_and_predictions_of_a_slp(self):
        slp = SlpFile(tracks=["ada", "bob"])
        slp.frame(0, [{"points": animal(20, 30), "track": 0, "hidden": [1]}, {"points": animal(70, 30), "track": 1}])
        # Of the same animal: a prediction, and the label that corrects it. And a second prediction, with confidences.
        slp.frame(2, [{"points": animal(1, 1), "track": 0, "score": 0.9}, {"points": animal(20, 40), "track": 0},
                      {"points": animal(60, 60), "track": 1, "score": 0.75}])
        slp.write(self.folder / "clip.slp")
        samples = self.build("clip.slp")
        self.assertEqual(sorted(samples), ["clip/train/img000.png#ada", "clip/train/img000.png#bob",
                                           "clip/train/img002.png#ada", "clip/train/img002.png#bob"])
        self.assert_points(samples["clip/train/img000.png#ada"], animal(20, 30), hidden=["eye_l"])
        self.assert_points(samples["clip/train/img000.png#bob"], animal(70, 30))
        self.assert_points(samples["clip/train/img002.png#ada"], animal(20, 40))
        self.assert_points(samples["clip/train/img002.png#bob"], animal(60, 60))
        self.assertAlmostEqual(float(samples["clip/train/img002.png#bob"]["keypoints_weight"][24]), 0.75, places=6)

    def test_a_correction_without_a_track_replaces_the_prediction_that_it_was_made_from(self):
        slp = SlpFile()
        slp.frame(1, [{"points": animal(1, 1), "score": 0.9}, {"points": animal(20, 40), "made_from": 0}])
        slp.write(self.folder / "clip.slp")
        samples = self.build("clip.slp")
        self.assertEqual(list(samples), ["clip/train/img001.png#0"])
        self.assert_points(samples["clip/train/img001.png#0"], animal(20, 40))

    def test_old_files_have_another_origin(self):
        slp = SlpFile(format_id=1.0)
        slp.frame(1, [{"points": animal(20, 40)}])
        slp.write(self.folder / "clip.slp")
        self.assert_points(self.build("clip.slp")["clip/train/img001.png#0"], animal(20, 40) - 0.5)

    def test_a_video_that_is_a_list_of_pictures(self):
        names = ["C:\\data\\frames\\img003.png", "C:\\data\\frames\\img001.png"]
        slp = SlpFile(video={"backend": {"type": "ImageVideo", "filename": names}})
        slp.frame(0, [{"points": animal(20, 40)}])
        slp.frame(1, [{"points": animal(30, 40)}])
        slp.write(self.folder / "clip.slp")
        points = {sample["image_ref"].decode() if "image_ref" in sample else name: sample
                  for name, sample in self.build("clip.slp").items()}
        self.assertEqual(len(points), 2)
        by_nose = {float(sample["keypoints_px"][24][0]): name for name, sample in points.items()}
        self.assertIn("img003.png", by_nose[50.0])
        self.assertIn("img001.png", by_nose[60.0])

    def test_two_videos_have_folders_of_their_names(self):
        walk, trot = ({"backend": {"filename": f"C:\\videos\\{name}.mp4"}} for name in ("walk", "trot"))
        slp = SlpFile(video=[walk, trot])
        slp.frame(0, [{"points": animal(20, 40)}], video=0)
        slp.frame(3, [{"points": animal(30, 40)}], video=0)
        slp.frame(0, [{"points": animal(40, 40)}], video=1)
        slp.write(self.folder / "clips.slp")
        for name, pictures in (("walk", "03"), ("trot", "0")):
            for i in pictures:
                path = self.folder / "frames" / name / f"f{i}.png"
                path.parent.mkdir(exist_ok=True)
                Image.open(self.folder / "frames" / f"img00{i}.png").rotate(180 if name == "trot" else 0).save(path)
        samples = self.build("clips.slp")
        self.assertEqual(sorted(samples), ["clip/train/trot/f0.png#0", "clip/train/walk/f0.png#0",
                                           "clip/train/walk/f3.png#0"])
        self.assert_points(samples["clip/train/walk/f3.png#0"], animal(30, 40))
        self.assert_points(samples["clip/train/trot/f0.png#0"], animal(40, 40))

    def test_frames_that_are_smaller_than_the_video(self):
        slp = SlpFile(video={"backend": {"filename": "clip.mp4", "shape": [4, 240, 320, 1]}})
        slp.frame(1, [{"points": animal(40, 80)}])
        slp.write(self.folder / "clip.slp")
        self.assertIn("size_mismatch", self.build("clip.slp", expect=1).stderr)
        sample = self.build("clip.slp", resized="scale")["clip/train/img001.png#0"]
        self.assert_points(sample, animal(40, 80) / 2)

    def test_what_a_slp_cannot_say_is_refused(self):
        several = SlpFile(videos=2)
        several.frame(0, [{"points": animal(20, 40)}], video=0)
        several.frame(0, [{"points": animal(20, 40)}], video=1)
        several.write(self.folder / "several.slp")
        self.assertIn("labels of the 2 videos clip", self.build("several.slp", expect=1).stderr)
        fewer = SlpFile()
        fewer.frame(0, [{"points": animal(20, 40)}])
        fewer.write(self.folder / "fewer.slp", nodes=NODES[:3])
        self.assertIn("got 4 points, expected the skeleton's 3", self.build("fewer.slp", expect=1).stderr)
        beyond = SlpFile()
        beyond.frame(0, [{"points": animal(20, 40)}])
        beyond.frames[0] = (0, 0, 0, 0, 9)
        beyond.write(self.folder / "beyond.slp")
        self.assertIn("expected rows within the 1", self.build("beyond.slp", expect=1).stderr)

    def write_analysis(self, path, transposed=False, scores=True, tracks=("ada", "bob")):
        """Two tracks, three frames; the second track is not in the first frame."""
        positions = np.full((2, 2, 4, 3), NONE)
        for frame in range(3):
            positions[0, :, :, frame] = animal(20 + frame, 30).T
            positions[1, :, :, frame] = animal(80 + frame, 30).T if frame else NONE
        points = np.where(np.isnan(positions[:, 0]), NONE, 0.7)
        with h5py.File(path, "w") as file:
            file["node_names"] = np.array(NODES, dtype="S")
            file["track_names"] = np.array(list(tracks), dtype="S")
            if not transposed:
                file["tracks"] = positions
                if scores:
                    file["point_scores"] = points
                return
            file["tracks"] = positions.transpose(3, 0, 2, 1)
            file["tracks"].attrs["dims"] = json.dumps(["n_frames", "n_tracks", "n_nodes", "n_space"])
            if scores:
                file["point_scores"] = points.transpose(2, 0, 1)

    def test_an_analysis_in_both_orders_of_its_dimensions(self):
        for transposed in (False, True):
            with self.subTest(transposed=transposed):
                self.write_analysis(self.folder / "clip.analysis.h5", transposed)
                samples = self.build("clip.analysis.h5")
                self.assertEqual(len(samples), 5)
                self.assertNotIn("clip/train/img000.png#bob", samples)
                self.assert_points(samples["clip/train/img002.png#ada"], animal(22, 30))
                self.assert_points(samples["clip/train/img002.png#bob"], animal(82, 30))
                self.assertAlmostEqual(float(samples["clip/train/img002.png#bob"]["keypoints_weight"][0]), 0.7, places=6)

    def test_an_analysis_without_scores_counts_as_labelled(self):
        self.write_analysis(self.folder / "clip.analysis.h5", scores=False)
        sample = self.build("clip.analysis.h5", form="deeplabcut")["clip/train/img001.png#bob"]
        self.assertEqual(sample["keypoints_weight"][0], 1.0)

    def test_the_same_analysis_as_csv(self):
        columns = [f"{node}.{axis}" for node in NODES for axis in ("x", "y", "score")]
        lines = [",".join(["track", "frame_idx", "instance.score", *columns])]
        for frame, x in ((0, 20), (2, 25)):
            cells = [f"{x_px},{y_px},0.9" for x_px, y_px in animal(x, 30)]
            lines.append(",".join(["ada", str(frame), "0.8", *cells]))
        (self.folder / "clip.analysis.csv").write_text("\n".join(lines) + "\n")
        samples = self.build("clip.analysis.csv")
        self.assertEqual(sorted(samples), ["clip/train/img000.png#0", "clip/train/img002.png#0"])
        self.assert_points(samples["clip/train/img002.png#0"], animal(25, 30))

    def test_predictions_of_lightning_pose(self):
        head = [["scorer"] + ["heatmap_tracker"] * 12 + ["set"],
                ["bodyparts"] + [node for node in NODES for _ in range(3)] + [""],
                ["coords"] + ["x", "y", "likelihood"] * 4 + [""]]
        rows = [[f"img{i:03}.png"] + [str(value) for point in animal(20 + i, 30) for value in (*point, 0.95)] + ["train"]
                for i in range(2)]
        rows[1][3] = "0.1"  # the likelihood of the nose
        (self.folder / "predictions.csv").write_text("\n".join(",".join(row) for row in head + rows) + "\n")
        samples = self.build("predictions.csv", form="lightning_pose")
        self.assert_points(samples["clip/train/img000.png#0"], animal(20, 30))
        self.assert_points(samples["clip/train/img001.png#0"], animal(21, 30), hidden=["nose"])

    def test_a_topology_is_drafted_and_drawn_from_a_slp(self):
        slp = SlpFile()
        slp.frame(1, [{"points": animal(20, 40)}])
        slp.write(self.folder / "clip.slp")
        out, sheet = self.folder / "drafts" / "mice.json", self.folder / "sheet.png"
        out.parent.mkdir()
        result = run("topology", "--from", self.folder / "clip.slp", "--out", out, "--sheet", sheet, "--images", "frames")
        draft = json.loads(out.read_text())
        self.assertEqual(draft["flip_pairs"], [["eye_l", "eye_r"]])
        self.assertEqual(draft["animal3d26"], {"left_eye": "eye_l", "right_eye": "eye_r", "tail_base": "tail",
                                               "nose": "nose"})
        self.assertIn("4 keypoint names", result.stderr)
        pixels = np.asarray(Image.open(sheet)).astype(int)
        # The animal's box with its margin fills the tile, so that the two eyes' discs are where they should be.
        for colour, node in (((86, 180, 233), 1), ((240, 159, 0), 2)):
            x, y = animal(20, 40)[node]
            box = animal(20, 40)
            low, high = box.min(0), box.max(0)
            side = (high - low).max() * 1.2 * 1.5  # box_margin of the loader, then the sheet's
            left, top = (low + high) / 2 - side / 2
            column = int((x - left + 0.5) * 560 / side - 0.5)
            row = int((y - top + 0.5) * 560 / side - 0.5)
            np.testing.assert_allclose(pixels[row + 30, column + 6], colour, atol=3)  # beside legend and gap
        self.assertIn("--force", run("topology", "--from", self.folder / "clip.slp", "--out", out, expect=2).stderr)
        said = run("topology", "--from", self.folder / "clip.slp", "--out", out, "--force").stderr
        self.assertIn("--images frames --sheet sheet.png", said)  # the only folder of pictures beside the labels
        self.assertIn("--images names the folder",
                      run("topology", "--from", self.folder / "clip.slp", "--topology", out, "--sheet", sheet,
                          expect=1).stderr)
