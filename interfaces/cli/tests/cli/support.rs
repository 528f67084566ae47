//! Running the program in a folder of its own.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use antumbra_image::Image;
use serde_json::Value;
use tempfile::TempDir;

/// A folder that disappears with the test, and the program in it.
pub struct Place {
    folder: TempDir,
}

/// What the program said and returned.
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

impl Place {
    /// An empty folder.
    pub fn empty() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self { folder }
    }

    /// A folder with the small scene `room.pbrt`: two walls and a floor, a tetrahedron from a PLY file
    /// and a sphere, lit by a small square and the sky.
    pub fn with_room() -> Self {
        let place = Self::empty();
        place.write("room.pbrt", ROOM);
        place.write("thing.ply", TETRAHEDRON);
        place
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).expect("a file in a temporary folder");
    }

    /// Names of the files, sorted.
    pub fn files(&self) -> Vec<String> {
        files(self.folder.path())
    }

    pub fn image(&self, name: &str) -> Image {
        Image::read(self.path(name)).expect("a readable image")
    }

    pub fn json(&self, name: &str) -> Value {
        let text = fs::read_to_string(self.path(name)).expect("a readable file");
        serde_json::from_str(&text).expect("JSON")
    }

    /// Runs the program here with these arguments.
    pub fn run(&self, args: &[&str]) -> Run {
        let output: Output = Command::new(env!("CARGO_BIN_EXE_antumbra"))
            .args(args)
            .current_dir(self.folder.path())
            .env_remove("NO_COLOR")
            .env_remove("ANTUMBRA_EMBREE")
            .output()
            .expect("the program starts");
        let text = |bytes| String::from_utf8(bytes).expect("text");
        Run {
            code: output.status.code().expect("no signal"),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }

    /// Lines of a table of comma-separated values, and the fields of each.
    pub fn rows(&self, name: &str) -> Vec<Vec<String>> {
        let text = fs::read_to_string(self.path(name)).expect("a table");
        let fields = |line: &str| line.split(',').map(str::to_owned).collect();
        text.lines().map(fields).collect()
    }

    /// Runs the program here and presses Ctrl-C so long after it began to listen; returns the exit code.
    #[cfg(target_os = "linux")]
    pub fn interrupt(&self, args: &[&str], after: std::time::Duration) -> Option<i32> {
        use std::process::Stdio;

        let mut child = Command::new(env!("CARGO_BIN_EXE_antumbra"))
            .args(args)
            .current_dir(self.folder.path())
            .env_remove("ANTUMBRA_EMBREE")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        // Until the program listens, the signal would end it the rude way. Signal 2 is bit 1.
        let listens = || {
            let status = fs::read_to_string(format!("/proc/{}/status", child.id()))?;
            let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
            let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
            std::io::Result::Ok(mask.is_some_and(|mask| mask & 2 != 0))
        };
        while !listens().expect("the program is running") {
            std::thread::yield_now();
        }
        std::thread::sleep(after);
        let kill = Command::new("kill")
            .args(["-INT", &child.id().to_string()])
            .status();
        assert!(kill.expect("kill starts").success());
        child.wait().expect("the program ends").code()
    }
}

impl Run {
    /// Checks the exit code; on failure shows what the program said.
    pub fn expect(self, code: i32) -> Self {
        let Self { stdout, stderr, .. } = &self;
        assert_eq!(self.code, code, "stdout:\n{stdout}\nstderr:\n{stderr}");
        self
    }

    /// The standard output as one JSON document.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).expect("JSON and nothing else")
    }
}

/// Names of the files in a folder, sorted.
pub fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name())
        .map(|name| name.into_string().expect("text"))
        .collect();
    names.sort();
    names
}

/// The names of an object's fields, in order.
pub fn fields(value: &Value) -> Vec<&str> {
    let object = value.as_object().expect("an object");
    object.keys().map(String::as_str).collect()
}

const ROOM: &str = r#"
LookAt 0 1.5 -5  0 1 0  0 1 0
Camera "perspective" "float fov" [50]
Film "image" "integer xresolution" [24] "integer yresolution" [16] "string filename" ["pictures/room.tga"]
Sampler "random" "integer pixelsamples" [4]
Integrator "path" "integer maxdepth" [3]
WorldBegin
LightSource "infinite" "rgb L" [0.2 0.25 0.3]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [12 11 10]
  Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [-0.5 3 -0.5  0.5 3 -0.5  0.5 3 0.5  -0.5 3 0.5]
AttributeEnd
Material "matte" "rgb Kd" [0.6 0.5 0.4]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3  3 2 4 3 4 5  0 3 5 0 5 6]
  "point P" [-3 0 -3  3 0 -3  3 0 3  -3 0 3  3 3 3  -3 3 3  -3 3 -3]
Material "plastic" "rgb Kd" [0.2 0.3 0.6] "float roughness" [0.1]
Shape "plymesh" "string filename" ["thing.ply"]
Translate 1.2 0.6 0
Shape "sphere" "float radius" [0.6]
WorldEnd
"#;

pub const TETRAHEDRON: &str = "ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
-1.5 0.01 -0.5
0 0.01 -0.5
-0.7 0.01 0.8
-0.7 1.4 0
3 0 1 2
3 0 3 1
3 1 3 2
3 2 3 0
";
