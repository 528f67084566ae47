//! The program from outside: what it prints, writes and returns.
//!
//! - `support`: running it in a folder of its own, and the scenes it is given
//! - `usage`: the command line and its mistakes
//! - `bad_scenes`: every mistake named, nothing written
//! - `damaged`: damaged scenes and meshes end in a picture or a complaint
//! - `farming`: names that schedulers and shells could misread
//! - `outputs`: what outputs may replace: never an input, another output or a stranger's file
//! - `rendering`: `render` and what it promises about its picture
//! - `resuming`: interruptions, parts, learned orders, farms
//! - `killing`: bakes that are killed and go on
//! - `signals`: TERM, INT and USR1 at any moment
//! - `studying`: `study`, row by row
//! - `benching`: `bench`, with and without Embree
//! - `describing`: `info`
//! - `looking`: viewers, what is said meanwhile, and the standard input
//! - `occlusion`: `ao`;  `sunlight`: `sun`;  `sight`: `visible`
//! - `terrain`: height rasters and viewsheds;  `mapping`: maps of their cells;  `around`: terrain around a scene;  `placing`: sensors on surfaces, and times of `sun`
//! - `grouping`: results by object and facade, elevations, moving shadows; `factors`;  `horizons`: `horizon`
//! - `plans`: tiles and shares of jobs;  `cities`: scenes in many files
//! - `book`: links, tables and code of the pages for readers
//! - `looks`: meshes with materials, camera flags, layers, pictures for displays
//! - `cameras`: cameras in `info` and `ao`, and light from images around a mesh
//! - `inputs`: tables, weather files and parts
//! - `images`: `image compare`, `convert` and `heatmap`
//! - `telling`: `list`, `completions`, `man` and `--version`

mod around;
mod bad_scenes;
mod benching;
mod book;
mod cameras;
mod cities;
mod damaged;
mod describing;
mod farming;
mod grouping;
mod horizons;
mod images;
mod inputs;
mod killing;
mod looking;
mod looks;
mod mapping;
mod occlusion;
mod outputs;
mod placing;
mod plans;
mod rendering;
mod resuming;
mod sight;
mod signals;
mod studying;
mod sunlight;
mod support;
mod telling;
mod terrain;
mod usage;
