#[path = "lab.rs"] #[allow(dead_code, unused)] mod lab;
use kisspoint::gap::{fit::*, nuisance, series::*};
use kisspoint::effects::*;
use kisspoint::vehicle::Vehicle;
// lab2 DIR RECORDING|- effect.param=value ...   : fit with these effects started there, print cost table, dump recording
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (v, recs) = lab::load(std::path::Path::new(&a[1]));
    let p = Problem { series: recs.iter().map(Series::new).collect(), vehicle: Vehicle::from_value(&v).unwrap(), nuisances: nuisance::read(&v).unwrap() };
    let mut st = p.nominal();
    let mut effs = vec![];
    for s in &a[3..] {
        let (n, val) = s.split_once('=').unwrap();
        let k = PARAMETERS.iter().position(|q| format!("{}.{}", q.effect, q.name) == n).unwrap();
        st.effects[k] = val.parse().unwrap();
        let e = find(PARAMETERS[k].effect).unwrap();
        if !effs.contains(&e) { effs.push(e); }
    }
    let f = fit(&p, &effs, &st, 12);
    println!("cost {:.0} z {:.2?} th {:.1?}", f.cost, f.point.z, f.point.theta_shift);
    for &e in &effs { for k in REGISTRY[e].parameters.clone() { println!("  {} {:.5}", PARAMETERS[k].variable, f.point.effects[k]); } }
    for (i, s) in p.series.iter().enumerate() {
        print!("{} {:13}", s.name, s.manoeuvre);
        let mut o = 0;
        for c in 0..5 { let n = s.measured[c].len(); if n == 0 { continue; }
            let r = &f.residuals[i][o..o + n]; o += n;
            let b: Vec<f64> = r.chunks(10).map(|x| x.iter().sum::<f64>() / (x.len() as f64).sqrt()).collect();
            print!("  {}: {:7.2} blk {:8.2}", ["wf", "wc", "x", "T", "th"][c], r.iter().map(|x| huber(*x)).sum::<f64>() / n as f64, b.iter().map(|x| x * x).sum::<f64>() / b.len() as f64); }
        println!();
        if s.name == a[2] {
            let pr = kisspoint::gap::predict::predict(s, &p.plant_at(&f.point).0, &p.plant_at(&f.point).1, f.point.theta_shift[i], kisspoint::gap::predict::Follow::Horizon(0.25));
            let mut w = String::new();
            for k in 0..s.len() { w += &format!("{} {} {}", k as f64 * s.dt, s.t_e[k], s.x_to[k]); for c in 0..5 { w += &format!(" {} {}", s.measured[c].get(k).unwrap_or(&f64::NAN), pr.value[c][k]); } w += &format!(" {}\n", pr.phase[k]); }
            std::fs::write("/work/scratch/dump.txt", w).unwrap();
        }
    }
}
