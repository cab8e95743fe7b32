//! The independent renderer as a photographer: materials, and series of photographs of a can of each.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use inks::ggx;
use testing::needs::{self, Need};

/// The renderer, where there is one.
pub fn renderer() -> Option<PathBuf> {
    needs::path(Need::Reference, "FOILPRESS_REFERENCE").filter(|_| needs::numpy())
}

/// A diffuse part and a lobe: reflectances, F0 and alpha.
#[derive(Clone, Copy)]
pub struct Material {
    pub name: &'static str,
    pub stack: &'static str,
    pub diffuse: [f64; 3],
    pub f0: [f64; 3],
    pub alpha: f64,
    /// How much shorter the exposures are than the renderer's own.
    pub shorter: f64,
}

/// From paper to foil.
pub const MATERIALS: [Material; 7] = [
    Material {
        name: "paper",
        stack: "substrate",
        diffuse: [0.84, 0.85, 0.88],
        f0: [0.04; 3],
        alpha: 0.28,
        shorter: 1.0,
    },
    Material {
        name: "magenta",
        stack: "M",
        diffuse: [0.69, 0.02, 0.2],
        f0: [0.04; 3],
        alpha: 0.12,
        shorter: 1.0,
    },
    Material {
        name: "finish",
        stack: "C+F",
        diffuse: [0.02, 0.23, 0.6],
        f0: [0.04; 3],
        alpha: 0.05,
        shorter: 1.0,
    },
    Material { name: "silver", stack: "MS", diffuse: [0.1; 3], f0: [0.57; 3], alpha: 0.27, shorter: 1.0 },
    Material {
        name: "gold",
        stack: "MG",
        diffuse: [0.09, 0.07, 0.03],
        f0: [0.54, 0.41, 0.2],
        alpha: 0.29,
        shorter: 1.0,
    },
    Material {
        name: "gold foil",
        stack: "GF",
        diffuse: [0.015; 3],
        f0: [0.84, 0.66, 0.31],
        alpha: 0.06,
        shorter: 8.0,
    },
    Material {
        name: "silver foil",
        stack: "SF",
        diffuse: [0.015; 3],
        f0: [0.85; 3],
        alpha: 0.06,
        shorter: 8.0,
    },
];

impl Material {
    pub fn at(&self, theta: f64) -> [f64; 3] {
        std::array::from_fn(|c| 0.96 * self.diffuse[c] / PI + self.f0[c] * ggx::lobe(theta, self.alpha))
    }

    fn csv(&self, path: &Path) {
        let mut text = String::from("theta_h_deg,r,g,b\n");
        for i in 0..=1780 {
            let degrees = f64::from(i) * 0.05;
            let [r, g, b] = self.at(degrees.to_radians());
            let _ = writeln!(text, "{degrees},{r:e},{g:e},{b:e}");
        }
        std::fs::write(path, text).unwrap();
    }

    pub fn times(&self) -> Vec<f64> {
        [0.25, 1.0 / 15.0, 1.0 / 60.0, 1.0 / 250.0, 1.0 / 1000.0, 1.0 / 4000.0]
            .map(|t| t / self.shorter)
            .to_vec()
    }
}

/// A photograph of 16 bits.
pub type Picture = image::ImageBuffer<image::Rgb<u16>, Vec<u16>>;

/// A picture as the renderer stores it: NumPy's format, 16 bits.
pub struct Raw {
    width: usize,
    height: usize,
    values: Vec<u16>,
}

impl Raw {
    pub fn read(path: &Path) -> Raw {
        let bytes = std::fs::read(path).unwrap();
        let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        let text = String::from_utf8_lossy(&bytes[10..header]).into_owned();
        assert!(text.contains("<u2"), "{text}");
        let shape = text.split("'shape': (").nth(1).unwrap().split(')').next().unwrap();
        let sizes: Vec<usize> = shape.split(',').filter_map(|s| s.trim().parse().ok()).collect();
        let values = bytes[header..].chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
        Raw { width: sizes[1], height: sizes[0], values }
    }

    /// Half the size without a margin; 8, 8 is its middle, so that a double-size picture gives shifts of half a pixel.
    pub fn halved(&self, (dx, dy): (usize, usize)) -> Raw {
        let (width, height) = (self.width / 2 - 8, self.height / 2 - 8);
        let at = |x: usize, y: usize, c: usize| u32::from(self.values[3 * (y * self.width + x) + c]);
        let values = (0..3 * width * height)
            .map(|i| {
                let (x, y, c) = (2 * (i / 3 % width) + dx, 2 * (i / 3 / width) + dy, i % 3);
                let four = [at(x, y, c), at(x + 1, y, c), at(x, y + 1, c), at(x + 1, y + 1, c)];
                // A full part of a pixel fills it in a real sensor; a mean with one would look like data.
                if four.iter().any(|v| *v >= 65_520) { 65_520 } else { (four.iter().sum::<u32>() / 4) as u16 }
            })
            .collect();
        Raw { width, height, values }
    }

    pub fn save(self, path: &Path) {
        let buffer = image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(
            self.width as u32,
            self.height as u32,
            self.values,
        );
        buffer.unwrap().save(path).unwrap();
    }
}

/// What is rendered besides the renderer's own choices: keyword arguments of its function `photo`.
pub fn render(script: &Path, material: &Material, times: &[f64], extra: &str, folder: &Path) {
    let curve = folder.join("truth.csv");
    material.csv(&curve);
    let code = format!(
        "import importlib.util as u, sys\ns = u.spec_from_file_location('r', sys.argv[1]); m = u.module_from_spec(s); s.loader.exec_module(m)\n\
         m.photo(m.load_curve(sys.argv[2]), sys.argv[3], times={times:?}{extra})"
    );
    let done = Command::new("python3")
        .args(["-c", &code])
        .arg(script)
        .arg(&curve)
        .arg(folder.join("npy"))
        .output()
        .unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}

/// A series in a folder of its own: the photographs as PNG, and their times.
pub struct Rendered {
    folder: tempfile::TempDir,
    pub times: BTreeMap<String, f64>,
}

impl Rendered {
    pub fn new(script: &Path, material: &Material, extra: &str) -> Rendered {
        Rendered::with(script, material, extra, |_, raw| raw)
    }

    pub fn with(
        script: &Path,
        material: &Material,
        extra: &str,
        change: impl Fn(usize, Raw) -> Raw,
    ) -> Rendered {
        let folder = tempfile::tempdir().unwrap();
        let times = material.times();
        render(script, material, &times, extra, folder.path());
        std::fs::create_dir(folder.path().join("photos")).unwrap();
        let mut named = BTreeMap::new();
        for (i, time) in times.into_iter().enumerate() {
            let name = format!("exp_{i}.png");
            let raw = Raw::read(&folder.path().join(format!("npy/exp_{i}.npy")));
            change(i, raw).save(&folder.path().join("photos").join(&name));
            named.insert(name, time);
        }
        Rendered { folder, times: named }
    }

    pub fn photos(&self) -> PathBuf {
        self.folder.path().join("photos")
    }
}
