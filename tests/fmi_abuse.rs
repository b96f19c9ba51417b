//! Misuse of the shared library from C: `tests/abuse/abuse.c` on both models.

use kisspoint::fmi2::{controller, plant};
use kisspoint::vehicle::Vehicle;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The cdylib that cargo built along with this test.
fn library() -> PathBuf {
    let exe = std::env::current_exe().unwrap();
    let deps = exe.parent().unwrap();
    let places = [deps.join("libkisspoint.so"), deps.parent().unwrap().join("libkisspoint.so")];
    places.into_iter().find(|p| p.is_file()).expect("cargo builds the cdylib beside the tests")
}

fn compiled(name: &str, flags: &[&str]) -> PathBuf {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/abuse/abuse.c");
    let status = Command::new("cc").args(flags).arg("-std=c11").arg(source).arg("-o").arg(&out).args(["-ldl", "-lm", "-lpthread"]).status();
    assert!(status.expect("a C compiler is needed, as for every Rust program").success());
    out
}

/// URI of a folder with the vehicle file of the paper's car.
fn resources() -> String {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("abuse_resources");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("vehicle.json"), Vehicle::paper().to_value().to_string()).unwrap();
    format!("file://{}", folder.display())
}

/// What the C program needs to know about both models.
fn models() -> [(&'static str, &'static str, [String; 7]); 2] {
    use controller::vr as k;
    use plant::vr as p;
    let text = |references: [f64; 7]| references.map(|r| r.to_string());
    let numbers = |bounded, beyond, fixed, tunable, output, phase, input| {
        text([f64::from(bounded), beyond, f64::from(fixed), f64::from(tunable), f64::from(output), f64::from(phase), f64::from(input)])
    };
    [
        (
            "DrivelinePlant",
            plant::GUID,
            numbers(p::x_to, 50.1, p::friction_R_1, p::effect_engine_torque_bias_torque, p::omega_f, p::phase, p::x_to),
        ),
        (
            "ClutchController",
            controller::GUID,
            numbers(k::controller_torque_max, 2000.1, k::friction_R_1, k::controller_kp_engine, k::T_fc_hat, k::phase, k::omega_f),
        ),
    ]
}

fn run(runner: &[&str], program: &Path, quick: bool) {
    for (name, guid, numbers) in models() {
        let mut words: Vec<String> = runner.iter().map(|w| (*w).to_owned()).collect();
        words.extend([program.display().to_string(), library().display().to_string(), name.into(), guid.into()]);
        words.extend(numbers);
        words.push(resources());
        words.extend(quick.then(|| "quick".to_owned()));
        let output = Command::new(&words[0]).args(&words[1..]).output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        print!("{name}: {said}");
        assert!(output.status.success(), "{name}: {said}{}", String::from_utf8_lossy(&output.stderr));
        assert!(said.contains(" passed, 0 failed"), "{said}");
    }
}

#[test]
fn every_misuse_is_refused_or_correct() {
    run(&[], &compiled("abuse", &["-O1"]), false);
}

#[test]
#[ignore = "needs valgrind; minutes"]
fn no_misuse_touches_memory_that_is_not_ours() {
    let program = compiled("abuse_valgrind", &["-O1", "-g"]);
    run(&["valgrind", "-q", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite"], &program, true);
}
