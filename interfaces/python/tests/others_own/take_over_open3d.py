"""A plugin of pytest: Open3D's RaycastingScene is ours."""

import antumbra.open3d
import open3d

open3d.t.geometry.RaycastingScene = antumbra.open3d.RaycastingScene
