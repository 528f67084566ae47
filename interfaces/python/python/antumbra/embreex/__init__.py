"""embreex, answered by antumbra: the same modules, classes and arguments, without Embree.

>>> import numpy as np
>>> from antumbra.embreex.mesh_construction import TriangleMesh
>>> from antumbra.embreex.rtcore_scene import EmbreeScene
>>> scene = EmbreeScene()
>>> mesh = TriangleMesh(scene, np.float32([[[0, 0, 1], [1, 0, 1], [0, 1, 1]]]))
>>> scene.run(np.float32([[0.2, 0.2, 0], [5, 5, 0]]), np.float32([[0, 0, 1]]))
array([ 0, -1], dtype=int32)

``antumbra.embreex.install()`` makes ``import embreex`` mean this package, also where embreex is not installed. Where the two
differ:

- All rays of a call are traced as a batch, by the threads of ``antumbra.set_threads``.
- Rays may be of any real type. Arrays of the caller are not written to: embreex writes distances into ``dists``.
- Both ends of a ray count. Answers are watertight: ``robust`` changes nothing.
- ``query="OCCLUDED"`` with ``output`` is an error, since embreex leaves those arrays without values.
"""

from __future__ import annotations

import sys

from . import mesh_construction, rtcore, rtcore_scene

__all__ = ["install", "mesh_construction", "rtcore", "rtcore_scene"]


def install() -> None:
    """Makes ``import embreex`` mean this package from here on.

    Modules that imported embreex before keep it: call this first.

    Examples
    --------
    >>> import sys
    >>> import antumbra.embreex
    >>> before = {name: module for name, module in sys.modules.items() if name.partition(".")[0] == "embreex"}
    >>> antumbra.embreex.install()
    >>> from embreex.rtcore_scene import EmbreeScene
    >>> EmbreeScene.__module__
    'antumbra.embreex.rtcore_scene'
    >>> for name in [name for name in sys.modules if name.partition(".")[0] == "embreex"]: del sys.modules[name]
    >>> sys.modules.update(before)
    """
    for name in [name for name in sys.modules if name.partition(".")[0] == "embreex"]:
        del sys.modules[name]
    sys.modules["embreex"] = sys.modules[__name__]
    for module in (mesh_construction, rtcore, rtcore_scene):
        sys.modules[module.__name__.replace("antumbra.embreex", "embreex", 1)] = module
