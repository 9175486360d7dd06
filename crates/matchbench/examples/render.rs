//! tmp
use matchbench::datasets::rendered::*;
fn main() {
    let out = std::env::args().nth(1).unwrap();
    let only = std::env::args().nth(2);
    let t = std::time::Instant::now();
    if let Some(only) = only {
        for s in sequences().iter().filter(|s| s.name == only) {
            let t = std::time::Instant::now();
            let w = World::build(s.place);
            eprintln!("{} built {:?}", s.name, t.elapsed());
            let t = std::time::Instant::now();
            for f in 0..std::env::args().nth(3).map_or(3, |n| n.parse().unwrap()) {
                w.render(s, f);
            }
            eprintln!("frame {:?}", t.elapsed());
        }
        return;
    }
    ensure(out.as_ref(), &|_| ()).unwrap();
    eprintln!("all {:?}", t.elapsed());
}
