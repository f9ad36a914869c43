"""Makes what the program reads: pictures, annotations, small networks and a small rendered world."""

import json

import numpy as np
from PIL import Image

from .program import run

FOCAL = 1000 / 256  # of the camera, in sides of the network's crop


def write_json(path, content):
    """Writes JSON, makes the folder where it is missing, and returns the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
    return path


def write_annotations(folder, records, name="train.json"):
    """Writes an annotation file in the `prima` format and returns its path."""
    return write_json(folder / name, {"data": records})


def prima_dataset(root, name="drawn", annotations="train.json", split="train", **more):
    """A dataset's entry in a config, in the `prima` format."""
    return {"name": name, "format": "prima", "root": str(root), "annotations": annotations, "split": split, **more}


def draw_pictures(folder, count, seed=5):
    """Draws noise pictures with a darker block into folder/images and returns their annotation records. Box and
    keypoints lie in the block."""
    generator = np.random.default_rng(seed)
    records = []
    (folder / "images").mkdir(parents=True, exist_ok=True)
    for i in range(count):
        pixels = generator.integers(0, 255, (150 + i, 200, 3), dtype=np.uint8)
        x, y = int(generator.integers(5, 60)), int(generator.integers(5, 40))
        pixels[y : y + 90, x : x + 110] //= 2
        Image.fromarray(pixels).save(folder / "images" / f"p{i:03}.png")
        keypoints = np.zeros((26, 3))
        keypoints[:, 0] = x + generator.uniform(0, 110, 26)
        keypoints[:, 1] = y + generator.uniform(0, 90, 26)
        keypoints[:, 2] = generator.random(26) < 0.8
        records.append({
            "img_path": f"images/p{i:03}.png", "mask_path": "", "bbox": [x, y, 110, 90],
            "keypoint_2d": keypoints.tolist(), "supercategory": i % 5, "height": 150 + i, "width": 200,
        })
    return records


def smooth_picture(seed, size=(200, 150)):
    """Blobs of colour. They have structure at all scales, as photographs have; noise loses its structure when it is
    resized."""
    generator = np.random.default_rng(1000 + seed)
    coarse, fine = (Image.fromarray(generator.integers(0, 255, shape, dtype=np.uint8)).resize(
        size, Image.Resampling.BICUBIC) for shape in ((9, 12, 3), (36, 48, 3)))
    return Image.blend(coarse, fine, 0.3)


def give_bodies(records, seed=17):
    """Adds a random body before the camera to every record and replaces the record's 2D keypoints by the exact
    projections of the body's 3D keypoints. Returns the records."""
    generator = np.random.default_rng(seed)
    for record in records:
        x, y, w, h = record["bbox"]
        centre, side = np.array([(2 * x + w) // 2, (2 * y + h) // 2]), max(w, h)
        points = generator.uniform(-0.4, 0.4, (26, 3)).astype(np.float32)
        trans = np.array([0.1, -0.2, generator.uniform(4, 8)], np.float32)
        camera = points.astype(float) + trans
        projected = FOCAL * camera[:, :2] / camera[:, 2:]
        visible = np.array(record["keypoint_2d"])[:, 2:]
        record.update(pose=generator.uniform(-1.5, 1.5, 105).tolist(), shape=generator.normal(size=20).tolist(),
                      shape_extra=generator.normal(size=21).tolist(), trans=trans.tolist(),
                      keypoint_3d=points.tolist(),
                      keypoint_2d=np.hstack([projected * side + centre, visible]).tolist())
    return records


def make_network(checkpoint, seed=None, body=None, priors=None):
    """Writes an untrained network of the smallest size and, where paths are given, its body model and priors."""
    options = {"--seed": seed, "--smal-asset": body, "--priors": priors}
    given = [word for option, value in options.items() if value is not None for word in (option, value)]
    run("init", "--size", "tiny", "--out", checkpoint, *given)


def render_world(folder):
    """Renders 3 % of the sample world, in small pictures."""
    run("sample", "--out", folder, "--share", 0.03, "--pixels", 160, "--quiet")


def world_superanimal(world, **more):
    """The rendered SuperAnimal test split, as a dataset's entry in a config."""
    return {"name": "superanimal", "format": "superanimal", "root": str(world / "superanimal_quadruped"),
            "annotations": "annotations/test.json", "images": "images", "split": "test", **more}


def world_animal3d(world):
    """The rendered Animal3D test split, as a dataset's entry in a config."""
    return prima_dataset(world / "animal3d", "animal3d", "test.json", "test")


def world_body(world):
    """The body model that the world was rendered with."""
    return world / "assets" / "smal_synthetic.safetensors"
