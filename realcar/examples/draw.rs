//! Writes cars to disk: `draw --seed S --cars N --out DIR --answers FILE`.
//!
//! Campaigns go to `DIR/case_001` and on, what they do not show to `DIR_unseen/case_001` and on, the answers to `FILE`.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let get = |name: &str| -> Result<&String, String> {
        let at = args.iter().position(|a| a == name).ok_or_else(|| format!("{name} is missing"))?;
        args.get(at + 1).ok_or_else(|| format!("{name} needs a value"))
    };
    let (seed, cars) = (get("--seed")?.parse()?, get("--cars")?.parse()?);
    let out = PathBuf::from(get("--out")?);
    let unseen = PathBuf::from(format!("{}_unseen", out.display()));
    let mut answers = BTreeMap::new();
    let mut shapes = BTreeMap::new();
    for (i, car) in realcar::draw(realcar::Settings { place: realcar::Place::Bench, seed, cars }).enumerate() {
        let name = format!("case_{:03}", i + 1);
        car.write(&out.join(&name))?;
        car.write_unseen(&unseen.join(&name))?;
        let ids: Vec<&str> = car.truth.effects.iter().map(|e| e.id).collect();
        let told: Vec<String> = car.truth.effects.iter().map(|e| format!("{}: {}", e.id, e.shape)).collect();
        answers.insert(name.clone(), ids);
        shapes.insert(name, told);
    }
    let file = get("--answers")?;
    std::fs::write(file, serde_json::to_string_pretty(&answers)?)?;
    if let Ok(file) = get("--shapes") {
        std::fs::write(file, serde_json::to_string_pretty(&shapes)?)?;
    }
    Ok(())
}
