#!/usr/bin/env python3
"""Finds animals and their keypoints in photographs with DeepLabCut, and writes them as a COCO file for `build`.

  detect_keypoints.py PHOTOS --out labels.json
      the 39 keypoints of DeepLabCut's SuperAnimal-Quadruped: "topology": "superanimal_quadruped"
  detect_keypoints.py PHOTOS --out labels.json --weights sa_finetune_hrnet_w32.pt --config sa_finetune_hrnet_w32.yaml
      the 26 keypoints of PRIMA's own detector: "topology": "animal3d"
  detect_keypoints.py PHOTOS --out labels.json --predictions predictions.json
      the same from predictions that an earlier run saved with --save-predictions

PHOTOS is a folder; JPEG and PNG files in it and below it are taken. DeepLabCut 3 is no part of this project's
environment: install it into one of its own (pip install --pre deeplabcut) and run this script with its Python. It
fetches the SuperAnimal weights on its first use; their licence is their own. PRIMA's weights and their config are
published with FMPose3D and PRIMA.

Each point has its confidence, from 0 to 1, in the place of COCO's v; `min_confidence` of a dataset says from which one
on it counts. A box has its score. A config takes the file so:

  { "name": "wild", "format": "coco", "root": "PHOTOS", "annotations": "labels.json", "topology": "animal3d" }

Exit codes: 0 written, 1 DeepLabCut failed or gave something else than expected, 2 wrong usage or not installed.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import sys
import tempfile
from typing import Any

import numpy as np
from PIL import Image, ImageOps

TOPOLOGIES = pathlib.Path(__file__).resolve().parents[1] / "configs" / "topologies"
SUFFIXES = (".jpg", ".jpeg", ".png")
ORIENTATION = 0x0112  # EXIF

Predictions = dict[str, dict[str, np.ndarray]]  # by the picture's name below PHOTOS


class DetectionError(RuntimeError):
    """DeepLabCut gave something else than expected."""


def pictures_in(folder: pathlib.Path) -> list[str]:
    """The names of all JPEG and PNG files in a folder and below it, relative to the folder, in order."""
    found = (path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())
    return sorted(path.relative_to(folder).as_posix() for path in found)


def keypoint_names(topology: str) -> list[str]:
    """The keypoints of a built-in topology, in its order."""
    return json.loads((TOPOLOGIES / f"{topology}.json").read_text(encoding="utf-8"))["keypoints"]


def detect(folder: pathlib.Path, names: list[str], options: argparse.Namespace) -> Predictions:
    """What DeepLabCut finds in the pictures. Throws SystemExit where it is not installed."""
    try:
        from deeplabcut.pose_estimation_pytorch.apis import superanimal_analyze_images
    except ImportError as error:
        print(f"detect_keypoints: DeepLabCut 3 is not installed here ({error}). Install it into an environment of its "
              "own: pip install --pre deeplabcut", file=sys.stderr)
        sys.exit(2)
    paths = {str(folder / name): name for name in names}
    custom = {}
    if options.weights:
        custom = {"customized_pose_checkpoint": str(options.weights), "customized_model_config": str(options.config)}
    with tempfile.TemporaryDirectory(prefix="detect_keypoints_") as drawn:  # DeepLabCut draws every picture
        found = superanimal_analyze_images(
            superanimal_name="superanimal_quadruped",
            model_name="hrnet_w32",
            detector_name="fasterrcnn_resnet50_fpn_v2",
            images=list(paths),
            max_individuals=options.most_animals,
            out_folder=str(options.drawings or drawn),
            device=options.device,
            bbox_threshold=options.min_box_score,
            **custom,
        )
    unknown = set(map(str, found)) - set(paths)
    if unknown:
        raise DetectionError(f"DeepLabCut gave predictions for {sorted(unknown)[0]}, which it was not asked for")
    return {paths[str(path)]: {key: np.asarray(value, float) for key, value in prediction.items()}
            for path, prediction in found.items()}


def animals(prediction: dict[str, np.ndarray], points: int, name: str) -> list[dict[str, Any]]:
    """The animals of one picture: `keypoints` (points, 3), and where the detector gave them `box` (x, y, w, h) and
    `score`. DeepLabCut fills its arrays up to the largest number of animals with -1; these rows are no animals.

    Throws DetectionError that names the picture where the arrays have another form than expected.
    """
    bodies = prediction.get("bodyparts")
    if bodies is None or bodies.ndim != 3 or bodies.shape[1:] != (points, 3):
        got = "none" if bodies is None else str(bodies.shape)
        raise DetectionError(f"{name}: bodyparts: got {got}, expected (animals, {points}, 3). Do --weights and --config "
                             "belong together, and was the right one of the two detectors named?")
    boxes, scores = prediction.get("bboxes"), prediction.get("bbox_scores")
    if boxes is not None and boxes.shape != (len(bodies), 4):
        raise DetectionError(f"{name}: bboxes: got {boxes.shape}, expected ({len(bodies)}, 4)")
    found = []
    for row, body in enumerate(bodies):
        padding = (body == -1).all() if boxes is None else (boxes[row] == -1).all()
        if padding or not (body[:, 2] > 0).any():
            continue
        animal: dict[str, Any] = {"keypoints": body}
        if boxes is not None:
            animal["box"] = boxes[row]
        if scores is not None:
            animal["score"] = float(np.ravel(scores)[row])
        found.append(animal)
    return found


def annotation(animal: dict[str, Any], size: tuple[int, int]) -> dict[str, Any] | None:
    """An animal as COCO has it, or None if no part of its box is in the picture. `size` is width and height in px."""
    entry: dict[str, Any] = {"category_id": 1, "iscrowd": 0}
    if "box" in animal:
        x, y, w, h = animal["box"]
        left, top = max(x, 0.0), max(y, 0.0)
        width, height = min(x + w, size[0]) - left, min(y + h, size[1]) - top
        if width <= 0 or height <= 0:
            return None
        entry |= {"bbox": [round(float(number), 2) for number in (left, top, width, height)],
                  "area": round(float(width * height), 2)}
    if "score" in animal:
        entry["score"] = round(animal["score"], 4)
    numbers = []
    for x, y, confidence in animal["keypoints"]:
        confidence = round(min(float(confidence), 1.0), 4)
        known = np.isfinite([x, y, confidence]).all() and confidence > 0
        numbers += [round(float(x), 2), round(float(y), 2), confidence] if known else [0, 0, 0]
    entry |= {"keypoints": numbers, "num_keypoints": sum(confidence > 0 for confidence in numbers[2::3])}
    return entry


def coco(folder: pathlib.Path, predictions: Predictions, topology: str) -> tuple[dict[str, Any], int]:
    """The COCO file, and how many of its pictures have an EXIF orientation. DeepLabCut sees pictures upright, so their
    sizes are stated so."""
    points = keypoint_names(topology)
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    turned = 0
    for name in sorted(predictions):
        with Image.open(folder / name) as picture:
            turned += picture.getexif().get(ORIENTATION, 1) != 1
            size = ImageOps.exif_transpose(picture).size
        images.append({"id": len(images) + 1, "file_name": name, "width": size[0], "height": size[1]})
        for animal in animals(predictions[name], len(points), name):
            if entry := annotation(animal, size):
                annotations.append({"id": len(annotations) + 1, "image_id": len(images), **entry})
    category = {"id": 1, "name": "quadruped", "supercategory": "animal", "keypoints": points}
    return {"images": images, "categories": [category], "annotations": annotations}, turned


def write(path: pathlib.Path, content: Any) -> None:
    """Writes JSON under a temporary name and renames it, so that the file is there as a whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def read_predictions(path: pathlib.Path, names: list[str]) -> Predictions:
    """What --save-predictions wrote. Throws DetectionError for a picture that the folder lacks."""
    content = json.loads(path.read_text(encoding="utf-8"))
    if missing := sorted(set(content) - set(names)):
        raise DetectionError(f"{path}: has predictions for {missing[0]}, which the folder of photographs lacks")
    return {name: {key: np.asarray(value, float) for key, value in prediction.items()}
            for name, prediction in content.items()}


def parsed(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photos", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="the COCO file to write")
    parser.add_argument("--weights", type=pathlib.Path, help="PRIMA's detector of 26 keypoints (a .pt file)")
    parser.add_argument("--config", type=pathlib.Path, help="DeepLabCut's config of that detector (a .yaml file)")
    parser.add_argument("--keypoints", type=int, choices=(26, 39), help="with --predictions: of which detector they are")
    parser.add_argument("--predictions", type=pathlib.Path, help="use these instead of running DeepLabCut")
    parser.add_argument("--save-predictions", type=pathlib.Path, metavar="FILE")
    parser.add_argument("--drawings", type=pathlib.Path, metavar="FOLDER", help="keep the pictures that DeepLabCut draws")
    parser.add_argument("--most-animals", type=int, default=5, help="in one photograph")
    parser.add_argument("--min-box-score", type=float, default=0.6, help="of the detector of animals")
    parser.add_argument("--device", help="as DeepLabCut names it: cpu, cuda, cuda:1")
    options = parser.parse_args(arguments)
    if bool(options.weights) != bool(options.config):
        parser.error("--weights and --config belong together")
    if bool(options.predictions) != bool(options.keypoints):
        parser.error("--predictions needs --keypoints 26 or 39, and --keypoints needs --predictions")
    if not options.photos.is_dir():
        parser.error(f"{options.photos}: expected a folder of photographs")
    return options


def main(arguments: list[str] | None = None) -> int:
    options = parsed(arguments)
    names = pictures_in(options.photos)
    if not names:
        print(f"detect_keypoints: {options.photos}: there is no JPEG or PNG file in it", file=sys.stderr)
        return 2
    topology = "animal3d" if options.weights or options.keypoints == 26 else "superanimal_quadruped"
    try:
        predictions = (read_predictions(options.predictions, names) if options.predictions
                       else detect(options.photos, names, options))
        if options.save_predictions:
            write(options.save_predictions, {name: {key: value.tolist() for key, value in prediction.items()}
                                             for name, prediction in sorted(predictions.items())})
        content, turned = coco(options.photos, predictions, topology)
    except DetectionError as error:
        print(f"detect_keypoints: {error}", file=sys.stderr)
        return 1
    write(options.out, content)
    print(f"{options.out}: {len(content['annotations'])} animals in {len(content['images'])} photographs; "
          f'"topology": "{topology}"')
    if turned:
        print(f'{turned} photographs have an EXIF orientation and were seen upright: set "orientation": "exif" in the '
              "dataset")
    return 0


if __name__ == "__main__":
    sys.exit(main())
