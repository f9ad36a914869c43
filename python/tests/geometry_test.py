"""Crops and cameras, against golden numbers of the official code."""

import json
import unittest

import numpy as np

from support import REPOSITORY, read_safetensors
from quadruped3d import body, geometry, pictures

PARITY = REPOSITORY / "tests" / "data" / "parity"


class OfficialCrops(unittest.TestCase):
    """The official do_augmentation and get_example on eight pictures; tests/data/parity/README.md."""

    @classmethod
    def setUpClass(cls):
        cls.golden = read_safetensors(PARITY / "augment.safetensors")
        cls.records = json.loads((PARITY / "crops" / "ann.json").read_text())["data"]

    def cases(self):
        for number in range(8):
            flags = self.golden[f"aug{number}_flags"]
            scale, rotation, shift_x, shift_y = self.golden[f"aug{number}_params"][:4]
            record = self.records[flags[3]]
            affine = geometry.augmented_patch_from_image(geometry.square_box(record["bbox"]), scale, rotation, shift_x,
                                                         shift_y)
            yield number, record, affine, flags

    def test_the_map_is_the_official_one_to_the_last_bit(self):
        for number, _, affine, _ in self.cases():
            np.testing.assert_array_equal(affine, self.golden[f"aug{number}__trans"])

    def test_the_pixels_are_the_official_ones(self):
        compared = 0
        for number, record, affine, flags in self.cases():
            if flags[4] != 0:  # made with the other border, which training does not use
                continue
            patch = pictures.cut_patch((PARITY / "crops" / record["img_path"]).read_bytes(), affine)
            golden = self.golden.get(f"aug{number}_warped_u8")
            if golden is None:
                golden, patch = self.golden[f"aug{number}_warped_u8_every4"], patch[::4, ::4]
            np.testing.assert_array_equal(patch.transpose(2, 0, 1), golden[:3])
            colour = self.golden[f"aug{number}_params"][4:]
            if patch.shape[0] == 256:
                planes = pictures.normalise(patch, tuple(colour))
                np.testing.assert_allclose(planes[:, ::8, ::8], self.golden[f"aug{number}_img_every8"], atol=1e-6)
            compared += 1
        self.assertEqual(compared, 6)

    def test_keypoints_are_the_official_ones(self):
        for number, record, affine, _ in self.cases():
            points = geometry.keypoints_to_crop(np.array(record["keypoint_2d"])[:, :2], affine)
            np.testing.assert_allclose(points, self.golden[f"aug{number}_keypoints_2d"][:, :2], atol=1e-6)


class Maps(unittest.TestCase):
    def test_a_map_and_its_inverse_give_the_identity(self):
        affine = geometry.augmented_patch_from_image((311.0, 207.0, 142.5), 1.2, -31.0, 0.01, -0.02, mirror=True)
        np.testing.assert_allclose(geometry.compose(affine, geometry.invert(affine)), np.eye(3)[:2], atol=1e-12)

    def test_composing_is_applying_one_map_after_the_other(self):
        first = geometry.patch_from_image((40.0, 50.0, 60.0), 1.1, 12.0)
        second = np.array([[0.5, 0.25, 3.0], [-0.25, 2.0, -7.0]])
        points = np.array([[1.0, 2.0], [30.0, -4.0]])
        np.testing.assert_allclose(geometry.map_points(geometry.compose(second, first), points),
                                   geometry.map_points(second, geometry.map_points(first, points)))

    def test_a_mirrored_patch_has_x_on_the_other_side_of_its_middle(self):
        box, point = (100.0, 80.0, 50.0), np.array([[110.0, 85.0]])
        plain = geometry.map_points(geometry.augmented_patch_from_image(box), point)
        mirrored = geometry.map_points(geometry.augmented_patch_from_image(box, mirror=True), point)
        np.testing.assert_allclose(mirrored, [[256.0 - plain[0, 0], plain[0, 1]]])

    def test_crop_units_lead_back_to_the_picture(self):
        box = geometry.square_box((20.0, 31.0, 120.0, 77.0))
        points = np.array([[25.0, 40.0], [139.0, 100.0]])
        units = geometry.keypoints_to_crop(points, geometry.patch_from_image(box))
        np.testing.assert_allclose(geometry.crop_to_image(units, box), points, atol=1e-4)

    def test_what_has_no_inverse_is_refused(self):
        with self.assertRaisesRegex(ValueError, "determinant"):
            geometry.invert([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0]])
        with self.assertRaisesRegex(ValueError, "without area"):
            geometry.patch_from_image((1.0, 2.0, 0.0))


class Cameras(unittest.TestCase):
    def test_projection_by_hand(self):
        # f = 1000 / 256; at depth 5, a point half a unit to the right lies at 0.5 f / 5.
        projected = geometry.project([[0.5, -0.25, 1.0]], [0.0, 0.0, 4.0])
        np.testing.assert_allclose(projected, [[0.390625, -0.1953125]])

    def test_translation_of_a_camera(self):
        np.testing.assert_allclose(geometry.translation_from_camera([0.5, 0.1, -0.2]), [0.1, -0.2, 15.625])

    def test_error_counts_visible_keypoints_alone(self):
        projected, annotated = np.zeros((26, 2)), np.full((26, 2), 100.0)
        annotated[3], annotated[7] = (0.1, -0.3), (0.0, 0.2)
        weight = np.zeros(26)
        weight[[3, 7]] = 1.0, 0.25
        self.assertAlmostEqual(float(geometry.projection_error(projected, annotated, weight)), 0.6 / 4)
        self.assertTrue(np.isnan(geometry.projection_error(projected, annotated, np.zeros(26))))


class Body(unittest.TestCase):
    def test_names_are_those_of_the_page(self):
        page = (REPOSITORY / "docs" / "body.md").read_text()
        for number, name in enumerate(body.KEYPOINTS):
            self.assertIn(f"| {number} | `{name}` |", page)
        for number, name in enumerate(body.JOINTS):
            self.assertIn(f"| {number} | `{name}` |", page)

    def test_mirror_images_exchange_left_and_right(self):
        for names, mirror in ((body.KEYPOINTS, body.KEYPOINT_MIRROR), (body.JOINTS, body.JOINT_MIRROR)):
            for name, other in zip(names, mirror, strict=True):
                swapped = name.replace("left", "?").replace("right", "left").replace("?", "right")
                self.assertEqual(names[other], swapped)

    def test_parents_come_before_children(self):
        for joint, parent in enumerate(body.JOINT_PARENTS):
            self.assertLess(parent, joint)

    def test_axis_angles_give_the_matrices_back(self):
        generator = np.random.default_rng(4)
        axes = generator.normal(size=(500, 3))
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        angles = np.concatenate([[0.0, 1e-9, np.pi, np.pi - 1e-9], generator.uniform(0, np.pi, 496)])
        cross = np.zeros((500, 3, 3))
        cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axes[:, 2], axes[:, 1], -axes[:, 0]
        cross -= cross.transpose(0, 2, 1)
        matrices = (np.eye(3) + np.sin(angles)[:, None, None] * cross  # Rodrigues' formula
                    + (1 - np.cos(angles))[:, None, None] * cross @ cross)
        vectors = body.axis_angle_from_matrix(matrices)
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), angles, atol=1e-7)
        expected = axes * angles[:, None]
        expected[2] *= np.sign(expected[2] @ vectors[2])  # a half turn about an axis is one about its opposite
        np.testing.assert_allclose(vectors, expected, atol=1e-7)

    def test_family_names(self):
        self.assertEqual(body.family_name(2), "equidae")
        self.assertEqual(body.family_name(-1), "none")
        with self.assertRaises(ValueError):
            body.family_name(5)


if __name__ == "__main__":
    unittest.main()
