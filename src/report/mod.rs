//! `report.html`: the answer of a diagnosis as a page that an engineer takes to a review.
//!
//! One file that needs no network: style, script and data are included. The order follows the questions asked in a review: the verdict with its doubts, where, the curves,
//! which, how far, what stays open, how it was computed. Figures exist twice: still ones for print and for browsers without scripts, and a viewer with linked cursor and zoom
//! that the script draws from [`series`].
//!
//! - [`text`]: escaping, and number formats for readers
//! - [`json`]: lenient reading of diagnosis.json, because a missing part must be reported, not guessed
//! - [`page`]: the shell that the report shares with the pages of [`fleet`] and [`compare`]
//! - [`chart`]: scales, ticks and paths of the still figures
//! - [`series`]: curves encoded as small integers, decimated if they are long
//! - [`what_if`]: data with which the viewer replays a recording with other sizes of an effect
//! - [`names`]: plain names of effects and subsystems for use in sentences
//! - one file per section: [`verdict`] with [`doubts`], [`residual_map`], [`curves`], [`causes`] with [`laws`], [`shrinkage`] with [`residuals`] and [`known`],
//!   [`open_questions`], [`provenance`]
//!
//! The same input gives the same bytes.

pub mod causes;
pub mod chart;
pub mod compare;
pub mod curves;
pub mod doubts;
pub mod fleet;
pub mod json;
pub mod known;
pub mod laws;
pub mod names;
pub mod open_questions;
pub mod page;
pub mod plan;
pub mod provenance;
pub mod residual_map;
pub mod residuals;
pub mod series;
pub mod shrinkage;
pub mod text;
pub mod timeline;
pub mod verdict;
pub mod what_if;

use serde_json::Value;

/// Content of the report.
pub struct Input<'a> {
    /// Name of the campaign for the reader; may be empty.
    pub name: &'a str,
    /// Content of diagnosis.json.
    pub diagnosis: &'a Value,
    /// Curves of each recording.
    pub overlays: &'a [Overlay],
    /// The drives among the recordings.
    pub drives: &'a [Drive],
    /// Versions, settings, fingerprint of the data: name and value.
    pub provenance: &'a [(String, String)],
    /// Sentence that defines the regions of the residual map; may be empty.
    pub regions: &'a str,
    /// Inputs of each overlay, in the order of `overlays`; may be empty.
    pub traces: &'a [series::Trace],
    /// Laws of the clutch, nominal and identified; may be empty.
    pub laws: &'a [laws::Law],
    /// Torque of the retuned plant along a held-out recording, with its standard deviation.
    pub known: Option<&'a known::Known>,
    /// Data that replay the overlays with other sizes of effects.
    pub what_if: Option<&'a what_if::WhatIf>,
}

impl<'a> Input<'a> {
    /// Input for a report that shows the answer alone.
    pub fn empty(diagnosis: &'a Value) -> Self {
        Self {
            name: "",
            diagnosis,
            overlays: &[],
            drives: &[],
            provenance: &[],
            regions: "",
            traces: &[],
            laws: &[],
            known: None,
            what_if: None,
        }
    }
}

pub use crate::gap::drive::Drive;
pub use crate::gap::measure::{Overlay, OverlayChannel};

const PLOT: &str = include_str!("plot.js");
const VIEWER: &str = include_str!("viewer.js");
const PLANT: &str = include_str!("plant.js");
const WHAT_IF: &str = include_str!("what_if.js");
const INPUT: &str = include_str!("input.js");
const EXPORT: &str = include_str!("export.js");

/// The whole report as one HTML document.
pub fn html(input: &Input) -> String {
    let retuned = series::retuned(input.diagnosis);
    let how_far = if retuned { "How far the gap shrinks" } else { "How large the gap is" };
    let sections = [
        ("where", "Where the gap lies", residual_map::section(input)),
        ("curves", if retuned { "Car, before and after" } else { "Car and model" }, curves::section(input)),
        ("which", "Which effect causes it", causes::section(input.diagnosis) + &laws::section(input)),
        ("how-far", how_far, shrinkage::section(input.diagnosis) + &known::section(input) + &residuals::section(input)),
        ("open", "Not judged, and what to measure next", open_questions::section(input.diagnosis)),
        ("computed", "How this was computed", provenance::section(input)),
    ];
    let title = [input.name, &verdict::headline(input.diagnosis)].iter().filter(|t| !t.is_empty()).copied().collect::<Vec<_>>().join(": ");
    page::html(&page::Page {
        title: &title,
        style: "",
        header: &verdict::section(input),
        sections: &sections,
        data: &[("series", series::embedded(input)), ("what-if-data", what_if::embedded(input))],
        script: &[PLOT, EXPORT, VIEWER, PLANT, WHAT_IF, INPUT].concat(),
    })
}

/// A line that states that something is absent, so that silence is not mistaken for a good result.
fn absent(what: &str) -> String {
    format!("<p class=\"absent\">{}</p>\n", text::escape(what))
}
