//! One HTML file that shows masks, what is seen of them, and the next one.
//!
//! Method: the page holds the frames cell by cell, the edges of the cells, and the stacks' curves as tables over the chord
//! between normal and half vector. It evaluates the forward model itself (`web/display.js` is [`seen()`](super::seen())
//! again), so light, eye, misalignment and depth follow the hand. Names come from files of unknown origin: the page sets them
//! as text.
//! Cost: one byte a cell and frame, deflated.

use appearance::brdf::{Space, reflectances};
use appearance::document::SAMPLES;
use inks::Library;
use press::html;
use press::preview::ToneCurve;
use serde_json::json;
use sheet::{DOTS_PER_MM, colours};

use super::grid::MARGIN;
use super::{DisplayError, Frame, Grid, Placed};
use crate::error::ViewError;
use crate::page::{STEPS, STYLE, filled, joined, packed, tables};

const SCRIPTS: [&str; 2] = [include_str!("../../web/data.js"), include_str!("../../web/display.js")];

/// What the page shows.
pub struct Subject<'a> {
    /// Its name, as text of unknown origin.
    pub name: &'a str,
    /// A line about it.
    pub about: &'a str,
    /// The grid.
    pub grid: &'a Grid,
    /// Frames with their names, the first one to begin with.
    pub frames: &'a [(String, Frame)],
    /// How the screen lies at first.
    pub placed: Placed,
    /// The ink library.
    pub library: &'a Library,
}

/// Writes the page.
///
/// # Errors
/// Data that cannot be packed: a bug if it is ever seen.
pub fn page(subject: &Subject) -> Result<String, DisplayError> {
    let grid = subject.grid;
    let space = Space::half_angle(SAMPLES);
    let looks = reflectances(grid.stacks(), subject.library, &space);
    let rows: Vec<&[f64]> = looks.rows().collect();
    let (cells, tile) = (grid.cells(), grid.tile());
    let edges =
        |cells: usize| (0..=cells).map(|cell| grid.edge(cell) as f64 / DOTS_PER_MM).collect::<Vec<f64>>();
    let frames = subject
        .frames
        .iter()
        .map(|(name, frame)| {
            let values = packed(&frame.values)?;
            Ok(json!({ "name": name, "values": values, "distance": frame.distance.map(|(mean, _)| mean) }))
        })
        .collect::<Result<Vec<_>, std::io::Error>>()
        .map_err(ViewError::from)?;
    let data = json!({
        "name": subject.name, "about": subject.about,
        "pixels": grid.pixels(), "cells": cells, "tile": tile, "margin": MARGIN,
        "order": (0..tile * tile).map(|i| grid.stack_in_tile(i % tile, i / tile)).collect::<Vec<_>>(),
        "edges": [edges(cells.0), edges(cells.1)], "side": grid.screen().cell_mm(),
        "passes": (0..=255u8).map(|value| grid.screen().passes(value)).collect::<Vec<f64>>(),
        "brightness": grid.brightness(), "white": ToneCurve::PAPER.exposure, "steps": STEPS,
        "stacks": grid.stacks().iter().map(ToString::to_string).collect::<Vec<_>>(),
        "colours": colours(grid.stacks()),
        "curves": packed(&tables(&space, &rows)).map_err(ViewError::from)?,
        "placed": { "shift": subject.placed.shift_mm, "depth": subject.placed.depth_mm },
        "frames": frames,
    });
    let data = serde_json::to_string(&data).map_err(ViewError::from)?;
    Ok(filled(
        include_str!("../../web/display.html"),
        &[
            (
                "{{head}}",
                html::head(
                    &format!("{} · Foilpress display", subject.name),
                    &[STYLE, include_str!("../../web/display.css")],
                ),
            ),
            ("{{title}}", html::escape(subject.name)),
            // `<` occurs only within strings.
            ("{{data}}", data.replace('<', "\\u003c")),
            ("{{script}}", SCRIPTS.map(joined).concat()),
        ],
    ))
}
