//! Names of the files of a rendering.

use std::path::{Path, PathBuf};

use antumbra_load::{Loaded, MemorySize, check_picture, file_stem};
use antumbra_render::Shard;
use antumbra_scene::Scene;

use super::checkpoint::{self, KEEP};
use super::looks;
use crate::args::RenderArgs;
use crate::exit::Failure;
use crate::json::Destination;
use crate::output::{self, Files};

/// Extension of the parts of a picture.
const PART: &str = "part";

/// Refuses names that cannot be meant, and notes the files that the command line names, before anything is read.
pub fn declare(args: &RenderArgs) -> Result<Files, Failure> {
    check_names(args)?;
    let mut files = Files::default();
    let written = [
        ("--output", args.output.as_deref()),
        ("--stderr-image", args.stderr_image.as_deref()),
        ("--save-order", args.save_order.as_deref()),
        ("--json", args.json.as_ref().map(Destination::path)),
    ];
    files.writes_some(written)?;
    if let Some(path) = &args.output {
        declare_beside(path, args, &mut files)?;
    }
    files.reads_some([
        ("the scene", Some(&*args.scene)),
        ("the order", args.load_order.as_deref()),
    ])?;
    files.check()?;
    Ok(files)
}

/// The name of the output, when the scene is known. Notes what else is read and written.
pub fn settle(
    args: &RenderArgs,
    loaded: &Loaded,
    memory: MemorySize,
    files: &mut Files,
) -> Result<PathBuf, Failure> {
    let scene = &loaded.scene;
    if args.layers {
        check_picture(scene, args.picture.spp, true, memory)?;
    }
    let file = match &args.output {
        Some(path) => path.clone(),
        None => {
            let path = default_output(scene, args.shard);
            files.writes("the image", &path)?;
            declare_beside(&path, args, files)?;
            if !args.overwrite {
                output::check_own(&path, "name an output with -o, or give --overwrite")?;
            }
            path
        }
    };
    files.reads_all(&loaded.inputs)?;
    files.check()?;
    Ok(file)
}

/// Notes the files that a rendering writes beside its output.
fn declare_beside(output: &Path, args: &RenderArgs, files: &mut Files) -> Result<(), Failure> {
    checkpoint::declare(output, files)?;
    let no_place = |flag: &str, what: &str| {
        let output = output.display();
        Failure::Usage(format!(
            "{flag}: there is no place beside {output} for {what}"
        ))
    };
    if args.keep_samples && output::checkpoint(output).is_none() {
        return Err(no_place(KEEP, "samples"));
    }
    if !args.preview {
        return Ok(());
    }
    let path = looks::preview(output).ok_or_else(|| no_place("--preview", "a preview"))?;
    files.writes("--preview", &path)?;
    output::check_own(&path, "take --preview or the file away")
}

/// Refuses names that cannot be meant, before anything is read.
fn check_names(args: &RenderArgs) -> Result<(), Failure> {
    args.display.check()?;
    let output = args.output.as_deref();
    let flags = [("--layers", args.layers), ("--metadata", args.metadata)];
    if let Some((flag, _)) = flags.into_iter().find(|(_, is_given)| *is_given) {
        check_name(output, &["exr"], &format!("{flag} needs an .exr"))?;
    }
    let sentence = format!("a shard is written as a .{PART}, for merge");
    let image = match args.shard {
        Some(_) => {
            check_name(output, &[PART], &sentence)?;
            None
        }
        None => output,
    };
    check_image_names(image, args.stderr_image.as_deref())
}

/// Refuses names of images that cannot be written.
pub fn check_image_names(image: Option<&Path>, errors: Option<&Path>) -> Result<(), Failure> {
    let known: Vec<_> = antumbra_image::writable_extensions().collect();
    let sentence = format!("images are written as {}", known.join(" or "));
    check_name(image, &known, &sentence)?;
    check_name(errors, &["exr"], "standard errors are written as exr")
}

/// Refuses a name with another extension than the known ones. Streams need none.
fn check_name(path: Option<&Path>, known: &[&str], sentence: &str) -> Result<(), Failure> {
    match path.filter(|path| !output::is_one_of(path, known) && !output::is_stream(path)) {
        Some(path) => Err(Failure::name(path, sentence)),
        None => Ok(()),
    }
}

/// The name that the scene gives its film, or the scene's own, in the current directory; the name of a shard says
/// which one it is.
fn default_output(scene: &Scene, shard: Option<Shard>) -> PathBuf {
    let image = default_image(scene);
    match shard {
        None => image,
        Some(shard) => {
            let mut name = image.file_stem().unwrap_or_default().to_owned();
            name.push(format!(".{}-of-{}.{PART}", shard.index(), shard.count()));
            name.into()
        }
    }
}

fn default_image(scene: &Scene) -> PathBuf {
    let film = scene.film.file_name.as_deref().map(Path::new);
    let path = film
        .and_then(Path::file_name)
        .map_or_else(|| file_stem(&scene.name).into(), PathBuf::from);
    if output::is_one_of(
        &path,
        &antumbra_image::writable_extensions().collect::<Vec<_>>(),
    ) {
        path
    } else if film.is_some() {
        path.with_extension("exr")
    } else {
        // Not `with_extension`: a dot in a scene's name is no extension.
        let mut name = path.into_os_string();
        name.push(".exr");
        name.into()
    }
}
