"""A plugin of pytest: embreex is ours."""

import antumbra.embreex

antumbra.embreex.install()
