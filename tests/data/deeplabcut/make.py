"""Makes the files of this folder with pandas, as DeepLabCut does: python make.py (pandas 2.2, PyTables 3.10).

Positions are frame + 10 * keypoint for x, and 100 + that for y, so that every number in the tests can be told by hand.
"""
import numpy as np
import pandas as pd

SCORER = "Ada"
PARTS = ["snout", "eye_l", "eye_r", "horn"]
PICTURES = [("labeled-data", "walk", f"img{i:03}.png") for i in (2, 0, 7)]


def position(frame, part):
    return float(frame + 10 * part), float(100 + frame + 10 * part)


def save(frame, name, **options):
    frame.to_hdf(f"{name}.h5", key="df_with_missing", mode="w", **options)
    frame.to_csv(f"{name}.csv")


def columns(individuals=None, coords=("x", "y"), unique=()):
    names = ["scorer", "bodyparts", "coords"]
    if individuals is None:
        return pd.MultiIndex.from_product([[SCORER], PARTS, coords], names=names)
    rows = [(SCORER, who, part, coord) for who in individuals for part in PARTS for coord in coords]
    rows += [(SCORER, "single", part, coord) for part in unique for coord in coords]
    return pd.MultiIndex.from_tuples(rows, names=["scorer", "individuals", "bodyparts", "coords"])


def labels():
    """A project's labels of one animal; the second keypoint of the second picture is missing."""
    values = np.array([[c for part in range(4) for c in position(frame, part)] for frame in range(3)])
    values[1, 2:4] = np.nan
    return pd.DataFrame(values, columns=columns(), index=["/".join(p) for p in PICTURES])


def labels_multi():
    """Two goats and a trough, rows named by three parts; no goat 2 in the second picture, nothing in the third."""
    values = np.array([[c for who in range(2) for part in range(4) for c in position(frame + 1000 * who, part)]
                       + [5.0, 6.0] for frame in range(3)])
    values[1, 8:16] = np.nan
    values[2] = np.nan
    return pd.DataFrame(values, columns=columns(["goat1", "goat2"], unique=["trough"]),
                        index=pd.MultiIndex.from_tuples(PICTURES))


def predictions(individuals=None):
    """A video's predictions: rows are frame numbers, and each point has a likelihood."""
    values = np.array([[c for who in range(2 if individuals else 1) for part in range(4)
                        for c in (*position(frame + 1000 * who, part), 0.95 - 0.25 * part)] for frame in range(3)])
    return pd.DataFrame(values, columns=columns(individuals, ("x", "y", "likelihood")))


if __name__ == "__main__":
    save(labels(), "labels")
    save(labels_multi(), "labels_multi")
    save(predictions(), "predictions", format="table")
    save(predictions(["goat1", "goat2"]), "predictions_multi", format="table", index=False)
