//! The sentence of an answer.

use super::compose::{Findings, named, position_free, rivals};
use super::model::unknown_clutch;
use super::prose::{listed, percent};
use super::verdict::Verdict;
use crate::effects::REGISTRY;

/// A list of effects, some of them with their rivals: "a or b, and c".
fn each_with_rivals(groups: &[String]) -> String {
    listed(groups, if groups.iter().any(|g| g.contains(" or ")) { ", and " } else { " and " })
}

/// Whether it is more probable than not that neither an effect nor any of its rivals is present.
fn likelier_not(f: &Findings, e: usize) -> bool {
    let mut group = rivals(f, e);
    group.push(e);
    let holds = f.posterior.explanations.iter().filter(|x| x.effects.iter().any(|k| group.contains(k)));
    holds.map(|x| x.probability).sum::<f64>() < 0.5
}

/// The sentence: verdict, effects, and the share `closed` of the gap that they close.
pub fn sentence(f: &Findings, closed: f64) -> String {
    let said = of_verdict(f, closed);
    if f.posterior.beyond <= 0.5 || matches!(f.conclusion.verdict, Verdict::Unexplained | Verdict::InputsDoNotFit) {
        return said;
    }
    let none = percent(f.posterior.beyond);
    format!(
        "With a probability of {none} none of the explanations compared holds: they strain the tolerances of the vehicle file. The nearest one: {said}"
    )
}

fn of_verdict(f: &Findings, closed: f64) -> String {
    let with_rivals = |e: usize| {
        let mut words = vec![REGISTRY[e].id];
        words.extend(rivals(f, e).iter().map(|&k| REGISTRY[k].id));
        words.join(" or ")
    };
    let effects = named(f);
    let names = each_with_rivals(&effects.iter().map(|&e| with_rivals(e)).collect::<Vec<_>>());
    let [helps, explains, closes] = if effects.len() == 1 { ["helps", "explains", "closes"] } else { ["help", "explain", "close"] };
    let c = f.conclusion;
    let places: Vec<&str> = c.unexplained_at.iter().chain(&c.or_at).map(|s| s.id()).collect();
    let at = listed(&places, " or ");
    let of_it = if closed > 0.0 { percent(closed) } else { "none".to_owned() };
    let share = format!("{of_it} of the gap on {}, which took no part in the fit", f.held_out_name);
    if matches!(c.verdict, Verdict::Explained | Verdict::PartlyExplained) && effects.iter().any(|e| likelier_not(f, *e)) {
        let rest = match c.verdict {
            Verdict::Explained => String::new(),
            _ => format!("; something structured remains in {at} that no effect in the library accounts for"),
        };
        return format!("The most probable explanation ({}) is {names}, which {closes} {share}{rest}.", percent(c.probability));
    }
    if let Some(mistake) = c.mistake {
        let (words, remedy) = (mistake.words(), mistake.remedy());
        return format!(
            "These inputs do not fit this vehicle: {words}, the recordings are explained far better than as they are mapped. {remedy}"
        );
    }
    match c.verdict {
        Verdict::NoGap if position_free(f) => format!(
            "No effect is needed in engine, driveline and sensors: there the model follows the car within the tolerances of its vehicle file. Without a position, {} are not assessable.",
            unknown_clutch::hidden()
        ),
        Verdict::NoGap => "No effect is needed: the model follows the car within the tolerances of its vehicle file.".to_owned(),
        Verdict::Explained if closed <= 0.0 => format!("{names} {explains} the gap in the recordings of the fit but {closes} {share}."),
        Verdict::Explained => format!("The gap is explained by {names}, which {closes} {share}."),
        Verdict::PartlyExplained if closed <= 0.0 => {
            format!(
                "{names} {helps} in the recordings of the fit but {closes} {share}; something structured remains in {at} that no effect in the library accounts for."
            )
        }
        Verdict::PartlyExplained => {
            format!(
                "{names} {helps} and {closes} {share}, but something structured remains in {at} that no effect in the library accounts for."
            )
        }
        Verdict::Unexplained => format!("There is a gap in {at} that no effect in the library accounts for."),
        Verdict::InputsDoNotFit if position_free(f) => {
            "These inputs do not fit this vehicle: such a car cannot have this torque and these speeds at once, whatever its clutch transmits. Check \
             the channel map: what T_e_Nm means, and which shafts the speeds belong to."
                .to_owned()
        }
        Verdict::InputsDoNotFit => {
            "These inputs do not fit this vehicle: such a car cannot have this torque, position and speed at once. Check \
             the channel map: what T_e_Nm means, which shafts the speeds belong to, and which way the position counts."
                .to_owned()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_written_as_people_write_them() {
        let of = |items: &[&str]| each_with_rivals(&items.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>());
        assert_eq!([of(&[]), of(&["a"]), of(&["a", "b"]), of(&["a", "b", "c"])], ["", "a", "a and b", "a, b and c"]);
        assert_eq!([of(&["a or b", "c"]), of(&["a", "b", "c or d"]), of(&["a or b"])], ["a or b, and c", "a, b, and c or d", "a or b"]);
    }
}
