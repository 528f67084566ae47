//! The page: everything a study has found, in one file that needs nothing else.

use std::path::Path;

use antumbra_image::atomic_write;
use minijinja::Environment;
use minijinja::value::Serde;
use serde::Serialize;

use super::blocks::Block;
use super::only;
use super::overview::overview;
use super::paper::{self, Figures};
use super::renderings::{Wipe, paper_table, wipe};
use super::replays::{best, gap, log_sizes, prediction, strip, transfer};
use super::summary::Summary;
use crate::Error;
use crate::study::{By, Document, Kind, Part, Plan, Row, Subject};
use crate::table::count;

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

#[derive(Serialize)]
struct Scene {
    id: String,
    name: String,
    facts: String,
    wipes: Vec<Wipe>,
    blocks: Vec<Block>,
}

/// Names of one list of the kernel.
#[derive(Serialize)]
struct Glossary {
    title: &'static str,
    terms: Vec<Term>,
}

#[derive(Serialize)]
struct Term {
    name: &'static str,
    sentence: &'static str,
    source: Option<&'static str>,
}

/// Names that the study uses, with the sentences of the kernel's lists.
fn glossary(plan: &Plan) -> Vec<Glossary> {
    macro_rules! list {
        ($title:literal, $names:expr) => {
            Glossary {
                title: $title,
                terms: ($names.iter())
                    .map(|entry| Term {
                        name: entry.name(),
                        sentence: entry.sentence(),
                        source: entry.source(),
                    })
                    .collect(),
            }
        };
    }
    vec![
        list!(
            "Orders: in which sequence children are visited",
            plan.orders
        ),
        list!("Trees: how the binary tree is built", plan.trees),
        list!("Collapses: how it is made wide", plan.collapses),
    ]
}

/// All of it, as the template has it.
#[derive(Serialize)]
struct Page {
    style: &'static str,
    script: &'static str,
    complete: bool,
    machine: String,
    version: &'static str,
    seed: u64,
    command: String,
    headline: Vec<[String; 4]>,
    advice: Option<String>,
    glossary: Vec<Glossary>,
    blocks: Vec<Block>,
    scenes: Vec<Scene>,
    replayed: bool,
    rows: usize,
}

/// Writes the page.
pub fn write(
    plan: &Plan,
    rows: &[(usize, Row)],
    document: &Document,
    folder: &Path,
) -> Result<(), Error> {
    let paper = paper::tables()?;
    let mut scenes = Vec::new();
    for (place, subject) in plan.scenes.iter().enumerate() {
        let of_scene = rows.iter().filter(|(scene, _)| *scene == place);
        let own: Vec<&Row> = of_scene.map(|(_, row)| row).collect();
        if !own.is_empty() {
            scenes.push(Scene::new(plan, subject, &own, &paper, folder)?);
        }
    }
    let all: Vec<&Row> = rows.iter().map(|(_, row)| row).collect();
    let summary = Summary::new(plan, rows);
    let machine = &document.machine;
    let mut environment = Environment::new();
    environment
        .add_template("report.html", TEMPLATE)
        .map_err(Error::report)?;
    let template = environment
        .get_template("report.html")
        .map_err(Error::report)?;
    let page = Page {
        style: STYLE,
        script: SCRIPT,
        complete: document.complete,
        machine: format!(
            "{}, {} {}",
            machine.describe(),
            std::env::consts::OS,
            std::env::consts::ARCH
        ),
        version: machine.version,
        seed: document.seed,
        command: machine.command_line.join(" "),
        headline: summary.headline(),
        advice: summary.advice(),
        glossary: glossary(plan),
        blocks: overview(plan, &all, &summary)?,
        scenes,
        replayed: all.iter().any(|row| row.by == By::Replay),
        rows: all.len(),
    };
    let text = template.render(Serde(&page));
    let text = text.map_err(Error::report)?;
    atomic_write(folder.join("report.html"), |file| {
        file.write_all(text.as_bytes())
    })?;
    Ok(())
}

impl Scene {
    fn new(
        plan: &Plan,
        subject: &Subject,
        rows: &[&Row],
        paper: &[Figures],
        folder: &Path,
    ) -> Result<Self, Error> {
        let first = rows[0];
        let rendered = rows.iter().find(|row| row.by == By::Render);
        let mut facts = format!("{} triangles", count(first.triangles as u64));
        if let Some(row) = rendered {
            facts.push_str(&format!(
                ", {} {} per pixel, {} shadow rays ({:.0} % of all rays, {:.0} % of them blocked)",
                row.spp,
                if row.spp == 1 { "sample" } else { "samples" },
                count(row.shadow_rays.unwrap_or(0)),
                100.0 * row.shadow_share.unwrap_or(0.0),
                100.0 * row.occluded_share,
            ));
        }
        let mut scene = Self {
            id: format!("scene-{}", subject.stem),
            name: subject.scene.name.clone(),
            facts,
            wipes: Vec::new(),
            blocks: Vec::new(),
        };
        for &width in &plan.widths {
            scene
                .wipes
                .extend(wipe(plan, subject, width, rows, folder)?);
            scene
                .blocks
                .extend(paper_table(plan, rows, width.lanes(), paper));
        }
        for kind in Kind::ALL {
            let part = |part| only(rows, |row| row.is_replay(kind, part));
            let techniques = part(Part::Techniques);
            if techniques.is_empty() {
                continue;
            }
            scene.blocks.push(strip(plan, &techniques, kind)?);
            scene.blocks.push(best(plan, &techniques, kind));
            scene.blocks.extend(prediction(plan, &techniques, kind)?);
            scene.blocks.extend(gap(plan, &techniques, kind)?);
            scene
                .blocks
                .extend(log_sizes(plan, &techniques, &part(Part::LogSize), kind)?);
            scene
                .blocks
                .extend(transfer(plan, &techniques, &part(Part::Transfer), kind)?);
        }
        Ok(scene)
    }
}
