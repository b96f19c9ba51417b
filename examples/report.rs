//! Writes the report of a synthetic campaign: `cargo run --example report -- report.html`.

#[path = "../tests/report/campaign.rs"]
mod campaign;

fn main() -> std::io::Result<()> {
    let target = std::env::args().nth(1).unwrap_or_else(|| "report.html".to_owned());
    let made = campaign::campaign();
    let input = kisspoint::report::Input {
        name: "a made-up car",
        diagnosis: &made.diagnosis,
        overlays: &made.overlays,
        drives: &[],
        provenance: &made.provenance,
        regions: "",
        traces: &[],
        laws: &[],
        known: None,
        what_if: None,
    };
    let html = kisspoint::report::html(&input);
    std::fs::write(&target, &html)?;
    println!("{target}: {} bytes", html.len());
    Ok(())
}
