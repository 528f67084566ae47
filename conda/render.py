"""Renders recipe.yaml beside this file for three systems, and prints the packages and what builds them."""
import pathlib

import rattler_build as rb

here = pathlib.Path(__file__).parent
recipe = rb.Stage0Recipe.from_file(here / "recipe.yaml")
for system in ("linux-64", "osx-arm64", "win-64"):
    platform = rb.PlatformConfig(target_platform=system, build_platform=system, host_platform=system, experimental=True)
    variants = rb.VariantConfig.from_file_with_context(here / "variants.yaml", rb.JinjaConfig(platform=platform))
    for rendered in recipe.render(variants, rb.RenderConfig(platform=platform)):
        package, needs = rendered.recipe.package, rendered.recipe.requirements
        print(f"{system}: {package.name} {package.version}, built with {', '.join(str(need) for need in needs.build)}")
