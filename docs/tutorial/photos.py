#!/usr/bin/env python3
"""Makes the folder that the tutorial begins with: photographs, and labels as a labelling tool exports them.

    python docs/tutorial/photos.py WORLD OUT

WORLD is a rendered world of `quadruped3d sample`, whose pictures stand for photographs. OUT gets photos/ with labels.json
and test_photos/ with test_labels.json: COCO files with 17 keypoints under names of our own. The truth stays behind, so
that this folder holds no more than a lab has.
"""

from __future__ import annotations

import json
import pathlib
import shutil
import sys

# Our keypoints, and which point of the rendered labels each of them is.
KEYPOINTS = {
    "nose": "nose", "eye_l": "left_eye", "eye_r": "right_eye", "ear_l": "left_earbase", "ear_r": "right_earbase",
    "withers": "back_base", "tail_base": "tail_base", "elbow_l": "front_left_thai", "elbow_r": "front_right_thai",
    "carpus_l": "front_left_knee", "carpus_r": "front_right_knee", "paw_fl": "front_left_paw",
    "paw_fr": "front_right_paw", "hock_l": "back_left_knee", "hock_r": "back_right_knee", "paw_bl": "back_left_paw",
    "paw_br": "back_right_paw",
}  # fmt: skip


def write(world: pathlib.Path, split: str, photos: pathlib.Path, labels: pathlib.Path) -> None:
    """Copies the pictures of a split and writes its labels."""
    source = world / "superanimal_quadruped"
    content = json.loads((source / "annotations" / f"{split}.json").read_text(encoding="utf-8"))
    names = content["categories"][0]["keypoints"]
    columns = [names.index(name) for name in KEYPOINTS.values()]
    photos.mkdir(parents=True, exist_ok=True)
    for image in content["images"]:
        image["file_name"] = pathlib.PurePosixPath(image["file_name"]).name  # some are whole paths of another machine
        shutil.copyfile(source / "images" / image["file_name"], photos / image["file_name"])
        image.pop("source_dataset", None)
    for annotation in content["annotations"]:
        points = [annotation["keypoints"][3 * column : 3 * column + 3] for column in columns]
        points = [[x, y, 2] if v > 0 else [0, 0, 0] for x, y, v in points]
        annotation["keypoints"] = [number for point in points for number in point]
        annotation["num_keypoints"] = sum(v > 0 for _, _, v in points)
    category = {"id": content["categories"][0]["id"], "name": "animal", "keypoints": list(KEYPOINTS)}
    labels.write_text(json.dumps({**content, "categories": [category]}), encoding="utf-8")


def main() -> int:
    if len(sys.argv) != 3:
        print("usage: photos.py WORLD OUT", file=sys.stderr)
        return 2
    world, out = map(pathlib.Path, sys.argv[1:])
    write(world, "train", out / "photos", out / "labels.json")
    write(world, "test", out / "test_photos", out / "test_labels.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
