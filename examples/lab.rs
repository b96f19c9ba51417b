use kisspoint::campaign::Recording;
use kisspoint::gap::{nuisance, series::*};
use kisspoint::vehicle::Vehicle;
use std::path::Path;
pub fn load(dir: &Path) -> (serde_json::Value, Vec<Recording>) {
    let v: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(dir.join("vehicle.json")).unwrap()).unwrap();
    let r: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(dir.join("recordings.json")).unwrap()).unwrap();
    let mut out = vec![];
    for (n, m) in r.as_object().unwrap() {
        let mut rd = csv::Reader::from_path(dir.join(format!("{n}.csv"))).unwrap();
        let h: Vec<String> = rd.headers().unwrap().iter().map(|s| s.to_string()).collect();
        let mut cols: Vec<Vec<f64>> = vec![vec![]; h.len()];
        for row in rd.records() { for (i, f) in row.unwrap().iter().enumerate() { cols[i].push(f.parse().unwrap()); } }
        let get = |s: &str| h.iter().position(|x| x == s).map(|i| cols[i].clone());
        out.push(Recording { name: n.clone(), manoeuvre: m["manoeuvre"].as_str().unwrap().into(), sample_rate_hz: m["sample_rate_Hz"].as_f64().unwrap(),
            theta_c0: m["theta_c0_degC"].as_f64().unwrap(), theta_b0: m["theta_b0_degC"].as_f64().unwrap(),
            omega_f: get("omega_f_rad_s").unwrap(), omega_c: get("omega_c_rad_s").unwrap(), t_e: get("T_e_Nm").unwrap(), x_to_cmd: get("x_to_cmd_mm").unwrap(),
            theta_h: get("theta_h_degC").unwrap(), x_to: get("x_to_mm"), t_fc: get("T_fc_Nm"), theta_c: get("theta_c_degC") });
    }
    (v, out)
}

use kisspoint::gap::fit::*;
use kisspoint::effects::*;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    for dir in &args[1..] {
    let (v, recs) = load(Path::new(dir));
    let vehicle = Vehicle::from_value(&v).unwrap();
    let t = std::time::Instant::now();
    let p = Problem { series: recs.iter().map(Series::new).collect(), vehicle, nuisances: nuisance::read(&v).unwrap() };
    let n: usize = p.series.iter().map(|s| s.measured.iter().map(|m| m.len()).sum::<usize>()).sum();
    let base = fit(&p, &[], &p.nominal(), 6);
    let r0 = p.all_residuals(&p.nominal()); 
    println!("{dir} N {n} nominal {:.0} base {:.0} prior {:.1} z {:.2?} th {:.1?} t {:?}", p.cost(&p.nominal(), &r0), base.cost, prior(&base.point), base.point.z, base.point.theta_shift, t.elapsed());
    let mut res: Vec<(f64, String)> = vec![];
    for (e, entry) in REGISTRY.iter().enumerate() {
        let mut best: Option<Fit> = None;
        for amp in [0.3, 1.0, -1.0] {
            let mut st = base.point.clone();
            for &k in entry.effect.amplitudes { st.effects[k] = (PARAMETERS[k].null + amp * PARAMETERS[k].nominal * if PARAMETERS[k].null==1.0 {0.1} else {1.0}).clamp(PARAMETERS[k].min, PARAMETERS[k].max); }
            if entry.is_null(&st.effects) { continue; }
            let f = fit(&p, &[e], &st, 6);
            if best.as_ref().is_none_or(|b| f.cost < b.cost) { best = Some(f); }
        }
        let b = best.unwrap();
        res.push((b.cost, format!("   {:26} {:8.0} left {:.3} {:?} prior {:.1}", entry.id, b.cost, (b.cost - n as f64) / (base.cost - n as f64), entry.parameters.clone().map(|k| format!("{} {:.4}", PARAMETERS[k].name, b.point.effects[k])).collect::<Vec<_>>(), prior(&b.point))));
    }
    res.sort_by(|a, b| a.0.total_cmp(&b.0));
    for r in res.iter().take(8) { println!("{}", r.1); }
    println!("t {:?}", t.elapsed());
    }
}
