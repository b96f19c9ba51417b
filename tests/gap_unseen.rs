//! A recording that took no part may refute effects, but not because its start temperature was noted a little off.

use kisspoint::campaign;
use kisspoint::effects;
use kisspoint::gap::decide::Unseen;
use kisspoint::gap::fit::fit;
use kisspoint::gap::nuisance;
use kisspoint::gap::predict::{Follow, HORIZON_S};
use kisspoint::gap::problem::{Point, Problem};
use kisspoint::gap::series::Series;
use kisspoint::vehicle::Vehicle;
use std::path::Path;

/// The bundled campaign's first recordings, and the next one with its start temperature noted this far off, K.
fn problems(off: f64) -> [Problem; 2] {
    let campaign = campaign::read(Path::new("tests/data/campaigns/example"), &Default::default()).unwrap();
    let of = |range: std::ops::Range<usize>| Problem {
        series: campaign.recordings[range].iter().map(Series::coarse).collect(),
        vehicle: Vehicle::from_value(&campaign.vehicle_json).unwrap(),
        nuisances: nuisance::read(&campaign.vehicle_json).unwrap(),
        follow: Follow::Horizon(HORIZON_S),
    };
    let mut unseen = of(4..5);
    unseen.series[0].theta_0[0] += off;
    [of(0..4), unseen]
}

#[test]
fn a_start_temperature_within_its_error_refutes_nothing_and_one_far_beyond_it_does() {
    let [seen, _] = problems(0.0);
    let effect = effects::find("kiss_point_thermal").unwrap();
    let mut start = seen.nominal();
    let (slope, value) = effects::REGISTRY[effect].effect.starts[0][0];
    start.effects[slope] = value;
    let fitted = fit(&seen, &[effect], &start, 20, None).point;
    let judged = |off: f64| {
        let [_, unseen] = problems(off);
        let point = Point { theta_shift: unseen.nominal().theta_shift, ..fitted.clone() };
        Unseen::of(&unseen, &point)
    };
    let (right, off, wrong) = (judged(0.0), judged(2.0), judged(30.0));
    assert!(right.fraction().unwrap() > 0.95, "{right:?}");
    assert!(off.fraction().unwrap() > 0.9, "{off:?}");
    assert!(wrong.after > 5.0 * off.after, "{wrong:?} beside {off:?}");
}
