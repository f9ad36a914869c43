"""The program on labels that are doubtful, repeated, or of other keypoints than the topology's."""

from e2e.intake import NAMES, PLACES_OF_26, SIZE, TOPOLOGY, IntakeCase, animal, coco, dlc_rows, drawing


class Doubts(IntakeCase):
    def test_labels_that_cannot_be_meant(self):
        width, height = SIZE
        fractions = {n: (x / width, y / height) for n, (x, y) in animal().items()}
        away = {n: (x + 900, y) for n, (x, y) in animal().items()}
        minus = {n: (-1, -1) for n in NAMES}
        some_minus = {**animal(), "snout": (-1, -1), "eye_l": (0, 0)}
        for i in range(6):
            self.write(f"images/{i}.png", drawing(animal(dx=i)))
        document = coco([("0.png", fractions), ("1.png", away), ("2.png", minus), ("3.png", animal(dx=3)),
                         ("4.png", animal(dx=4)), ("5.png", some_minus)])
        boxes = [[50, 40, 170, 125], None, None, [0.2, 0.25, 0.55, 0.6], [100, 100, 3, 4], None]
        for annotation, box in zip(document["annotations"], boxes):
            if box:
                annotation["bbox"] = box
        self.write("labels.json", document)
        sample, = self.build("--quiet")
        self.assertEqual([reason for reason, _ in self.failures()], [
            "not_in_pixels", "box_outside_image", "no_visible_keypoints", "not_in_pixels", "box_too_small"])
        self.assertIn("between 0 and 1", self.failures()[0][1])
        self.assertEqual((sample["keypoints_weight"][24], sample["keypoints_weight"][0]), (0, 0))
        self.assert_noted("where tools put points that nobody set, get weight 0: 2 records")

    def test_points_beside_their_box(self):
        self.write("images/a.png", drawing(animal()))
        document = coco([("a.png", animal()), ("a.png", animal())])
        document["annotations"][0]["bbox"] = [230, 150, 60, 40]
        document["annotations"][1]["bbox"] = [50, 60, 170, 105]  # the eyes lie a little outside
        self.write("labels.json", document)
        self.assertEqual(len(self.build()), 1)
        self.assertEqual([reason for reason, _ in self.failures()], ["keypoints_outside"])


class Copies(IntakeCase):
    def test_the_same_animal_is_counted_once(self):
        self.write("images/a.png", drawing(animal(), animal(dx=20, dy=20)))
        self.write("images/copy.png", (self.folder / "images/a.png").read_bytes())
        rounded = {n: (x + 0.3, y - 0.4) for n, (x, y) in animal().items()}
        self.write("labels.json", coco([("a.png", animal()), ("a.png", animal(dx=20, dy=20)), ("copy.png", rounded),
                                        ("a.png", animal())]))
        self.assertEqual(len(self.build("--quiet")), 2)
        self.assertEqual(self.failures(), [("duplicate", "it is that of lab/train/a.png#0")] * 2)
        self.assert_noted("which is counted once: 2, first lab/train/copy.png#2")

    def test_labels_of_two_scorers(self):
        self.write("labeled-data/walk/img1.png", drawing(animal()))
        rows = [(("labeled-data", "walk", "img1.png"), animal())]
        for scorer in ("Ada", "Bo"):
            self.write(f"labeled-data/walk/CollectedData_{scorer}.csv", dlc_rows(rows, scorer, cells=3))
        dlc = {"format": "deeplabcut", "annotations": "labeled-data", "species": "dog"}
        self.build(expect=1, **dlc)
        self.assertIn("CollectedData_Ada.csv, CollectedData_Bo.csv", self.stderr)
        self.assertIn("config.yaml", self.stderr)
        self.write("config.yaml", "Task: walk\nscorer: Bo  # the second\n")
        self.assertEqual(len(self.build("--quiet", **dlc)), 1)
        self.assert_noted("CollectedData_Bo.csv is read, and CollectedData_Ada.csv beside it is left out")

    def test_backups_of_deeplabcut(self):
        rows = [(("labeled-data", "walk", "img1.png"), animal())]
        self.write("labeled-data/walk/img1.png", drawing(animal()))
        for name in ("Ada", "Adasingleanimal", "Adawindows"):
            self.write(f"labeled-data/walk/CollectedData_{name}.csv", dlc_rows(rows, cells=3))
        self.assertEqual(len(self.build("--quiet", format="deeplabcut", annotations="labeled-data")), 1)
        self.assert_noted("CollectedData_Adasingleanimal.csv, CollectedData_Adawindows.csv beside it is left out")


class Keypoints(IntakeCase):
    def test_keypoints_that_came_and_went(self):
        fewer = [name for name in NAMES if name not in ("paw_bl", "paw_br")]
        more = [*NAMES, "belly"]
        for i, (folder, names) in enumerate((("one", NAMES), ("two", fewer), ("three", more))):
            points = {**animal(dx=5 * i), "belly": (120, 120)}
            self.write(f"labeled-data/{folder}/img.png", drawing(animal(dx=5 * i)))
            self.write(f"labeled-data/{folder}/CollectedData_Ada.csv",
                       dlc_rows([(("labeled-data", folder, "img.png"), points)], names=names, cells=3))
        samples = self.build("--quiet", format="deeplabcut", annotations="labeled-data")
        self.assertEqual(len(samples), 3)
        for sample in samples:
            lacks = b"/two/" in sample["id"]
            self.assert_on_dots(sample, 6 if lacks else 8)
            self.assertEqual(sample["keypoints_v"][5], 0 if lacks else 1)
        self.assert_noted("keypoints of the topology eight that the file lacks, which get weight 0: 2 of 8 "
                          "(paw_bl, paw_br): 1 file, first labeled-data/two/CollectedData_Ada.csv")
        self.assert_noted("keypoints of the file that the topology eight lacks, which are left out: 1 of 9 (belly)")

    def test_names_of_another_spelling_are_refused_and_listed(self):
        names = [f"kp-{name}" for name in NAMES]
        self.write("images/a.png", drawing(animal()))
        points = {f"kp-{name}": place for name, place in animal().items()}
        self.write("labels.json", coco([("a.png", points)], names=names))
        self.build(expect=1)
        for name in ("kp-snout", "kp-paw_br", "eye_l"):
            self.assertIn(name, self.stderr)

    def test_categories(self):
        self.write("images/a.png", drawing(animal(), animal(dx=20, dy=20)))
        document = coco([("a.png", animal()), ("a.png", animal(dx=20, dy=20))])
        document["categories"].append({"id": 2, "name": "cat", "keypoints": ["whisker", "claw"]})
        document["annotations"][1].update(category_id=2, keypoints=[1, 1, 2, 2, 2, 2])
        self.write("labels.json", document)
        self.build(expect=1)
        self.assertIn("whisker", self.stderr)
        self.assertIn('the key "categories"', self.stderr)
        sample, = self.build(categories=["dog"])
        self.assert_on_dots(sample)
        self.build(expect=1, categories=["hound"])
        self.assertIn('"hound"', self.stderr)
        self.assertIn("dog, cat", self.stderr)

    def test_one_side(self):
        left = [name for name in NAMES if not name.endswith("r")]
        one_sided = {"name": "left", "keypoints": left, "flip_pairs": [],
                     "animal3d26": {place: name for place, name in TOPOLOGY["animal3d26"].items() if name in left}}
        self.write("left.json", one_sided)
        self.write("images/a.png", drawing(animal()))
        self.write("labels.json", coco([("a.png", animal())], names=left))
        sample, = self.build(topology="left.json")
        self.assert_on_dots(sample, 5)
        for name in ("eye_r", "paw_fr", "paw_br"):
            self.assertEqual(sample["keypoints_weight"][PLACES_OF_26[name]], 0)
