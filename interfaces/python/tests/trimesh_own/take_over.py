"""A plugin of pytest: every mesh of trimesh asks antumbra."""

import antumbra.trimesh

antumbra.trimesh.install()
