//! Table II of the paper: all nine numbers within 1 %.

use kisspoint::launch::{TABLE_II, simulate};
use kisspoint::vehicle::Vehicle;

#[test]
fn all_nine_numbers_are_within_one_percent() {
    for column in TABLE_II {
        let found = simulate(&column.setup(&Vehicle::paper())).performance.expect("the clutch locks");
        let pairs = [
            ("t_f in s", found.time, column.paper.time),
            ("E_d in J", found.energy, column.paper.energy),
            ("slip acceleration in rad/s2", found.slip_acceleration, column.paper.slip_acceleration),
        ];
        for (what, found, paper) in pairs {
            println!("{} {what}: {found:.4} against {paper}, {:+.2} %", column.name, 100.0 * (found / paper - 1.0));
            assert!((found / paper - 1.0).abs() < 0.01, "column {}, {what}: {found} against {paper}", column.name);
        }
    }
}
