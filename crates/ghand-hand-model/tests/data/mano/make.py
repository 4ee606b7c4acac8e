"""Writes the files of this folder with Python 3, NumPy and SciPy: python3 make.py

A hand of 2 joints and 4 vertices with made-up numbers, nothing of which comes from MANO, in the protocols 0 to 5 and as
.npz. chumpy, which runs on no Python of today, is stood in for by classes of the same names.
"""

import pickle
import sys
import types

import numpy as np
import scipy.sparse

chumpy, ch, reordering = (types.ModuleType(name) for name in ("chumpy", "chumpy.ch", "chumpy.reordering"))
sys.modules.update({m.__name__: m for m in (chumpy, ch, reordering)})


class Ch:
    pass


class Select(Ch):
    pass


Ch.__module__, Ch.__qualname__ = "chumpy.ch", "Ch"
Select.__module__, Select.__qualname__ = "chumpy.reordering", "Select"
ch.Ch, reordering.Select = Ch, Select

V, N, SHAPES, USED = 4, 2, 3, 2


def count(*shape):
    """1/3, 2/3, 1, ... so that most mantissas are full."""
    return np.arange(1, np.prod(shape) + 1).reshape(shape) / 3.0


# On a parabola, so that the triangles have an area.
template = count(V, 3) ** 2
shapes = Ch()
shapes.x, shapes._dirty_vars, shapes._itr = count(V, 3, SHAPES), {"x"}, None
selected = Select()
selected.a = shapes
selected.idxs = np.arange(V * 3 * SHAPES).reshape(V, 3, SHAPES)[:, :, :USED].ravel()
selected.preferred_shape = (V, 3, USED)
regressor = np.array([[0.25, 0.75, 0, 0], [0, 0, 0.5, 0.5]])

hand = {
    "v_template": np.asfortranarray(template),
    "f": np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32),
    "weights": np.array([[1, 0], [0.5, 0.5], [0.25, 0.75], [0, 1]]),
    "kintree_table": np.array([[2**32 - 1, 0], [0, 1]], dtype=np.uint32),
    "J_regressor": scipy.sparse.csc_matrix(regressor),
    "J": regressor @ template,
    "shapedirs": selected,
    "posedirs": np.asfortranarray(count(V, 3, 9 * (N - 1))),
    "hands_mean": count(3).astype(">f8"),
    "hands_components": count(3, 3),
    "bs_type": "lrotmin",
}

for protocol in range(6):
    with open(f"protocol{protocol}.pkl", "wb") as file:
        pickle.dump(hand, file, protocol)
plain = hand | {"shapedirs": shapes.x[:, :, :USED]}
np.savez("stored.npz", **plain)
np.savez_compressed("deflated.npz", **plain | {"J_regressor": regressor})
