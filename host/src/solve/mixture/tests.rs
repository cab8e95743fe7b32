use std::path::PathBuf;
use std::time::Instant;

use super::*;
use crate::solve::modelled;
use inks::Curve;

fn measured(space: &Space) -> Option<Vec<(String, Vec<f64>)>> {
    let folder = PathBuf::from(std::env::var_os("FOILPRESS_DATA")?).join("brdf/curves_avg");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).ok()?.map(|f| f.unwrap().path()).collect();
    files.sort();
    let row = |p: &PathBuf| {
        (p.file_stem().unwrap().to_string_lossy().into_owned(), space.row(&Curve::read_csv(p).unwrap()))
    };
    Some(files.iter().map(row).collect())
}

#[test]
fn probe() {
    let space = Space::half_angle(32);
    let curves = modelled::table(&space);
    let hull = Hull::new(&space, &curves, &vec![0.0; curves.len()]).unwrap();
    let mut mixer = Mixer::new();
    let mut sum = 0.0;
    let rows = measured(&space).unwrap();
    let (mut steps, mut worst) = (0, 0);
    for (name, row) in &rows {
        let t = hull.target(row).unwrap();
        let best = match mixer.best(&hull, &t) {
            Ok(b) => b,
            Err(e) => {
                println!("{name} {e} {t:?}");
                for m in [Linear::Tangent, Linear::Plain] {
                    let mut a = vec![0.0; 57];
                    println!("{:?} {:?}", mixer.linear(&hull, &t, m, &mut a), a);
                    println!("{:?}", mixer.refine(&hull, &t, &mut a));
                    println!(
                        "{:?} {:?} {:?} {:?} {:?}",
                        mixer.slope, mixer.pull, mixer.stiffness, mixer.working, mixer.working_weights
                    );
                }
                panic!()
            }
        };
        let mut a = vec![0.0; hull.len()];
        mixer.tangent(&hull, &t, &mut a).unwrap();
        let fit = mixer.refine(&hull, &t, &mut a).unwrap();
        steps += fit.steps;
        worst = worst.max(fit.steps);
        println!("{name:45} {:.6} {:?} agree {} one {:?}", best.fit.distance, best.fit, best.agreeing, fit);
        sum += best.fit.distance;
    }
    println!("mean {} steps {} worst {}", sum / rows.len() as f64, steps as f64 / rows.len() as f64, worst);
    let now = Instant::now();
    for (_, row) in &rows {
        let t = hull.target(row).unwrap();
        mixer.best(&hull, &t).unwrap();
    }
    println!("all starts {:?}", now.elapsed() / rows.len() as u32);
    let now = Instant::now();
    for (_, row) in &rows {
        let t = hull.target(row).unwrap();
        let mut a = vec![0.0; hull.len()];
        mixer.tangent(&hull, &t, &mut a).unwrap();
    }
    println!("tangent {:?}", now.elapsed() / rows.len() as u32);
    let now = Instant::now();
    for (_, row) in &rows {
        let t = hull.target(row).unwrap();
        let mut a = vec![0.0; hull.len()];
        mixer.tangent(&hull, &t, &mut a).unwrap();
        mixer.refine(&hull, &t, &mut a).unwrap();
    }
    println!("one start {:?}", now.elapsed() / rows.len() as u32);
    // redundancy
    let mut ds = vec![];
    for i in 0..57 {
        let others: Vec<usize> = (0..57).filter(|&k| k != i).collect();
        let sub = hull.subset(&others);
        let t = sub.target(curves.row(i)).unwrap();
        ds.push((mixer.best(&sub, &t).unwrap().fit.distance, i));
    }
    ds.sort_by(|a, b| a.0.total_cmp(&b.0));
    println!(
        "{} {} median {}",
        ds.iter().filter(|d| d.0 < 0.002).count(),
        ds.iter().filter(|d| d.0 < 0.01).count(),
        ds[28].0
    );
    println!(
        "{:?}",
        ds.iter().take(24).map(|d| (modelled::stacks()[d.1].to_string(), d.0)).collect::<Vec<_>>()
    );
}
