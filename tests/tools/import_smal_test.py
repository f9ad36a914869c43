"""Tests the import of the SMAL body and priors, on files in the form of the official Python 2 pickles."""

import json
import os
import pathlib
import tempfile
import unittest

import numpy as np
import support  # first of ours: it sets the path

VERTICES, FACES, JOINTS, BETAS = 3889, 7774, 35, 41
REAL_FILES = os.environ.get("Q3D_SMAL_FOLDER")  # the folder that holds the two released pickles of the priors


class AssetCase(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.target = self.folder / "out.safetensors"

    def assert_fails(self, result, *mentions):
        self.assertEqual(result[:2], (1, ""))
        for mention in mentions:
            self.assertIn(mention, result[2])
        self.assertFalse(self.target.exists())


class BodyTest(AssetCase):
    @classmethod
    def setUpClass(cls):
        rng = np.random.default_rng(11)
        weights = rng.random((VERTICES, JOINTS))
        regressor = np.zeros((JOINTS, VERTICES))
        for joint in range(JOINTS):
            regressor[joint, rng.choice(VERTICES, 8, replace=False)] = 1 / 8
        parents = np.array([2**32 - 1, *rng.integers(0, np.arange(1, JOINTS))], np.uint32)
        cls.numbers = {
            "v_template": rng.normal(size=(VERTICES, 3)),
            "f": rng.integers(0, VERTICES, (FACES, 3)).astype(np.uint32),
            "shapedirs": rng.normal(size=(VERTICES, 3, BETAS)),
            "posedirs": rng.normal(size=(VERTICES, 3, 9 * (JOINTS - 1))).astype(np.float16),
            "weights": weights / weights.sum(1, keepdims=True),
            "J_regressor": regressor,
            "kintree_table": np.stack([parents, np.arange(JOINTS, dtype=np.uint32)]),
        }
        rows, columns = np.nonzero(regressor.T)[::-1]  # ordered by column, as csc stores them
        cls.sparse = {
            "data": regressor[rows, columns],
            "indices": rows.astype(np.int32),
            "indptr": np.concatenate([[0], np.cumsum((regressor != 0).sum(0))]).astype(np.int32),
            "_shape": regressor.shape,
        }

    def save(self, **changes):
        """Writes a model file with chumpy arrays, a scipy matrix, and a few fields that the importer ignores."""
        with support.foreign_classes(("chumpy.ch.Ch", object), ("scipy.sparse.csc.csc_matrix", object)) as made:

            def chumpy(values):
                wrapped = made.Ch()
                wrapped.x = values
                return wrapped

            regressor = made.csc_matrix()
            regressor.__dict__.update(self.sparse)
            model = dict(self.numbers) | {"bs_style": "lbs", "bs_type": "lrotmin", "J": chumpy(np.zeros((JOINTS, 3)))}
            model |= {key: chumpy(model[key]) for key in ("v_template", "shapedirs", "posedirs", "weights")}
            model |= {"J_regressor": regressor} | changes
            model = {key: value for key, value in model.items() if value is not None}
            path = self.folder / "model.pkl"
            path.write_bytes(support.python2_pickle(model, 2))
        return path

    def convert(self, **changes):
        return support.run("smal", self.save(**changes), self.target)

    def test_every_table(self):
        code, out, err = self.convert()
        self.assertEqual((code, err), (0, ""))
        tensors, metadata = support.read_safetensors(self.target)
        expected = {
            "v_template": self.numbers["v_template"].astype(np.float32),
            "faces": self.numbers["f"].astype(np.int32),
            "shapedirs": self.numbers["shapedirs"].astype(np.float32),
            "J_regressor": self.numbers["J_regressor"].astype(np.float32),
            "lbs_weights": self.numbers["weights"].astype(np.float32),
            "parents": self.numbers["kintree_table"][0].astype(np.int32),
        }
        for name, values in expected.items():
            np.testing.assert_array_equal(tensors[name], values, err_msg=name)
            self.assertEqual(tensors[name].dtype, values.dtype)
        self.assertEqual(tensors["parents"][0], -1)
        self.assertEqual(tensors["posedirs"].shape, (306, 3 * VERTICES))
        for vertex, axis, entry in ((0, 0, 0), (17, 2, 305), (3888, 1, 100)):
            got = tensors["posedirs"][entry, 3 * vertex + axis]
            self.assertEqual(got, self.numbers["posedirs"][vertex, axis, entry])
        self.assertEqual((metadata["format"], metadata["imported_from"]), ("quadruped3d-smal-1", "model.pkl"))
        self.assertIn("non-commercial", metadata["licence"])
        self.assertIn("3889 vertices", out)

    def test_keypoints_are_those_of_the_official_code(self):
        self.assertEqual(self.convert()[0], 0)
        tensors, _ = support.read_safetensors(self.target)
        official, _ = support.read_safetensors(os.path.join(support.PARITY, "smal_asset.safetensors"))
        np.testing.assert_array_equal(tensors["keypoint_vertices"], official["keypoint_vertices_flat"])
        np.testing.assert_array_equal(tensors["keypoint_offsets"], official["keypoint_vertices_offsets"])

    def test_other_forms_of_the_same_model(self):
        self.assertEqual(self.convert()[0], 0)
        expected = self.target.read_bytes()
        more = np.concatenate([self.numbers["shapedirs"], np.ones((VERTICES, 3, 4))], axis=2)
        signed = self.numbers["kintree_table"].astype(np.int64)
        signed[0, 0] = -1
        for changes in (
            {"shapedirs": more},  # only the first 41 directions are used
            {"J_regressor": self.numbers["J_regressor"]},
            {"kintree_table": signed},
            {"f": self.numbers["f"].astype(np.int64), "weights": self.numbers["weights"]},
        ):
            with self.subTest(changes=list(changes)):
                self.target.unlink()
                self.assertEqual(self.convert(**changes)[0], 0)
                self.assertEqual(self.target.read_bytes(), expected)

    def test_tables_that_do_not_fit(self):
        def changed(name, index, value):
            values = self.numbers[name].copy()
            values[index] = value
            return {name: values}

        loop = self.numbers["kintree_table"].copy()
        loop[0, 5] = 5
        for changes, mention in (
            ({"shapedirs": None}, "no field 'shapedirs'; it has: J, J_regressor"),
            ({"shapedirs": self.numbers["shapedirs"][:, :, :20]}, "shapedirs has 20 shape directions, expected 41"),
            ({"v_template": self.numbers["v_template"][:-1]}, "v_template has the shape [3888, 3], expected [3889, 3]"),
            ({"weights": "none"}, "weights is a str, expected an array"),
            (changed("v_template", (7, 1), np.nan), "v_template holds a number that is not finite"),
            (changed("v_template", (7, 1), 1e39), "v_template holds a number that is not finite in float32"),
            (changed("f", (0, 0), VERTICES), "f holds 0 to 3889, expected whole numbers from 0 to 3888"),
            (changed("weights", 9, 0.5), "lbs_weights: row 9 sums to 17.5, expected 1"),
            (changed("J_regressor", 3, 0), "J_regressor: row 3 sums to 0, expected 1"),
            ({"kintree_table": loop}, "gives joint 5 the parent 5, expected one of 0 to 4"),
            (changed("kintree_table", (0, 0), 3), "gives joint 0 the parent 3, expected -1"),
        ):
            with self.subTest(mention=mention):
                self.assert_fails(self.convert(**changes), "model.pkl", mention)

    def test_files_that_are_something_else(self):
        path = self.folder / "model.pkl"
        for content, mention in (
            (b"", "ends early"),
            (b"<html>sign in</html>", "a web page"),
            (b"(lp0\n.", "holds a list, expected a dict"),
            (b"cposix\nsystem\n(S'true'\ntR.", "posix.system"),
            (self.save().read_bytes()[:100_000], "ends early"),
        ):
            path.write_bytes(content)
            self.assert_fails(support.run("smal", path, self.target), "model.pkl", mention)


class PriorsTest(AssetCase):
    def setUp(self):
        super().setUp()
        rng = np.random.default_rng(12)
        self.means = rng.normal(size=(5, BETAS))
        roots = rng.normal(size=(5, BETAS, BETAS))
        self.covariances = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(BETAS)
        self.mean_pose = rng.normal(size=105)
        root = rng.normal(size=(105, 105))
        self.pose_covariance = root @ root.T + np.eye(105)
        self.factor = np.linalg.cholesky(np.linalg.inv(self.pose_covariance))

    def convert(self, families={}, pose={}):
        with support.foreign_classes(("chumpy.ch.Ch", object)) as made:
            factor = made.Ch()
            factor.x = self.factor
            shape = {"cluster_means": self.means, "cluster_cov": list(self.covariances), "toys_betas": self.means}
            prior = {"mean_pose": self.mean_pose, "pic": factor, "cov": self.pose_covariance}
            paths = self.folder / "families.pkl", self.folder / "pose.pkl"
            for path, table in zip(paths, (shape | families, prior | pose)):
                path.write_bytes(support.python2_pickle(table, 0))  # the protocol of the released files
        return support.run("priors", *paths, self.target)

    def test_every_table(self):
        code, _, err = self.convert()
        self.assertEqual((code, err), (0, ""))
        tensors, metadata = support.read_safetensors(self.target)
        self.assertEqual(metadata["format"], "quadruped3d-priors-1")
        self.assertEqual(metadata["imported_from"], "families.pkl, pose.pkl")
        np.testing.assert_array_equal(tensors["shape_prior_loss.mean_betas"], self.means.astype(np.float32))
        np.testing.assert_array_equal(tensors["pose_prior_loss.mean_pose"], self.mean_pose.astype(np.float32))
        np.testing.assert_array_equal(tensors["pose_prior_loss.precs"], self.factor.astype(np.float32))
        np.testing.assert_array_equal(tensors["pose_prior_loss.use_index"], [0, 0, 0] + [1] * 102)
        for factor, covariance in zip(tensors["shape_prior_loss.betas_prec"].astype(np.float64), self.covariances):
            self.assertEqual(np.abs(np.triu(factor, 1)).max(), 0)
            identity = factor @ factor.T @ (covariance + 1e-5 * np.eye(BETAS))
            np.testing.assert_allclose(identity, np.eye(BETAS), atol=2e-4)
        self.assertEqual({values.dtype for values in tensors.values()}, {np.dtype(np.float32)})

    def test_tables_that_do_not_fit(self):
        negative = list(self.covariances)
        negative[2] = -negative[2]
        for arguments, mention in (
            (({"cluster_cov": negative},), "families.pkl: cluster_cov holds a matrix that is not a covariance"),
            (({"cluster_means": self.means[:4]},), "families.pkl: cluster_means has the shape [4, 41], expected [5"),
            (({}, {"pic": self.factor[:30, :30]}), "pose.pkl: pic has the shape [30, 30], expected [105, 105]"),
            (({}, {"cov": 2 * self.pose_covariance}), "pose.pkl: pic pic^T cov differs from the identity"),
            (({}, {"pic": np.full((105, 105), 1e200)}), "pose.pkl: pic pic^T cov differs from the identity by nan"),
            (({}, {"mean_pose": None}), "pose.pkl: mean_pose is a NoneType"),
        ):
            with self.subTest(mention=mention):
                self.assert_fails(self.convert(*arguments), mention)

    @unittest.skipUnless(REAL_FILES, "Q3D_SMAL_FOLDER does not name the folder with the released pickles")
    def test_the_released_files_give_the_official_numbers(self):
        names = "my_smpl_data_00781_4_all.pkl", "walking_toy_symmetric_pose_prior_with_cov_35parts.pkl"
        self.assertEqual(support.run("priors", *(os.path.join(REAL_FILES, name) for name in names), self.target)[0], 0)
        tensors, _ = support.read_safetensors(self.target)
        with open(os.path.join(support.PARITY, "losses_A.json"), encoding="utf-8") as file:
            official = json.load(file)["meta"]["real_prior_checksums"]
        sums = {name.split(".")[1]: values.astype(np.float64) for name, values in tensors.items()}
        got = {
            "pose_precs_sum": sums["precs"].sum(),
            "pose_precs_abs_sum": np.abs(sums["precs"]).sum(),
            "mean_pose_sum": sums["mean_pose"].sum(),
            "betas_prec_abs_sum": np.abs(sums["betas_prec"]).sum(),
            "mean_betas_abs_sum": np.abs(sums["mean_betas"]).sum(),
        }
        self.assertEqual(set(got), set(official))
        for name, value in official.items():
            np.testing.assert_allclose(got[name], value, rtol=1e-8, err_msg=name)


if __name__ == "__main__":
    unittest.main()
