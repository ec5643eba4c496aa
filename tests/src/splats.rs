//! Free Gaussians without our file in between: a plain PLY of floats, written, read and drawn in
//! f64 by the formulas of 3D Gaussian Splatting, which share no code with reader, runtime or format.

use dermis_runtime::Camera;
use dermis_trainer::optimize::schedule::Random;

/// A PLY of one element whose properties are all f32.
#[derive(Clone, Debug, Default)]
pub struct SplatPly {
    /// Names of the properties.
    pub names: Vec<String>,
    /// Numbers of each Gaussian, as many as names.
    pub rows: Vec<Vec<f32>>,
}

impl SplatPly {
    /// `count` Gaussians of 2 to 20 cm in a cube of 1 m around the origin, all of them seen.
    pub fn random(count: u32, degree: usize, seed: u64) -> Self {
        let rest = 3 * ((degree + 1).pow(2) - 1);
        let names = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2".split(' ').map(str::to_owned);
        let rests = (0..rest).map(|i| format!("f_rest_{i}"));
        let last = "opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split(' ');
        let names: Vec<String> = names.chain(rests).chain(last.map(str::to_owned)).collect();
        let mut random = Random::new(seed);
        let mut number = |name: &str| {
            let x = 2.0 * random.unit() - 1.0;
            match name {
                "x" | "y" | "z" => 0.5 * x,
                "opacity" => 3.0 * x,
                _ if name.starts_with("scale") => -3.0 + 0.9 * x,
                _ if name.starts_with("f_rest") => 0.3 * x,
                _ => x,
            }
        };
        let rows = (0..count).map(|_| names.iter().map(|name| number(name)).collect()).collect();
        Self { names, rows }
    }

    /// What the 32 bytes a Gaussian of a `.splat` file say: position and scales in metres as f32, then
    /// r, g, b, a and the quaternion w, x, y, z in bytes.
    pub fn of_splat_file(bytes: &[u8]) -> Self {
        let ply = Self::random(0, 0, 0);
        let row = |splat: &[u8; 32]| {
            let float = |i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|b| splat[4 * i + b]));
            let color = |i: usize| (f32::from(splat[24 + i]) / 255.0 - 0.5) / 0.282_094_8;
            let alpha = f32::from(splat[27]) / 255.0;
            let turn = |i: usize| (f32::from(splat[28 + i]) - 128.0) / 128.0;
            let number = |name: &String| match name.as_str() {
                "x" | "y" | "z" => float(usize::from(name.as_bytes()[0] - b'x')),
                "opacity" => (alpha / (1.0 - alpha)).ln(),
                _ => match name.split_at(name.len() - 1) {
                    ("f_dc_", i) => color(i.parse().expect("a digit")),
                    ("scale_", i) => float(3 + i.parse::<usize>().expect("a digit")).ln(),
                    ("rot_", i) => turn(i.parse().expect("a digit")),
                    _ => 0.0,
                },
            };
            ply.names.iter().map(number).collect()
        };
        Self { rows: bytes.as_chunks::<32>().0.iter().map(row).collect(), names: ply.names.clone() }
    }

    /// The same Gaussians, their properties in another order.
    pub fn shuffled(&self, seed: u64) -> Self {
        let mut columns: Vec<usize> = (0..self.names.len()).collect();
        Random::new(seed).shuffle(&mut columns);
        let row = |row: &Vec<f32>| columns.iter().map(|&column| row[column]).collect();
        Self {
            names: columns.iter().map(|&column| self.names[column].clone()).collect(),
            rows: self.rows.iter().map(row).collect(),
        }
    }

    /// The same Gaussians, one number replaced.
    ///
    /// # Panics
    ///
    /// Where there is none of this name.
    pub fn with(&self, row: usize, name: &str, number: f32) -> Self {
        let mut other = self.clone();
        let column = self.names.iter().position(|n| n == name).expect("it has this property");
        other.rows[row][column] = number;
        other
    }

    /// Reads a binary file such as [`Self::bytes`] writes.
    ///
    /// # Panics
    ///
    /// Where the bytes are none.
    pub fn parse(bytes: &[u8]) -> Self {
        const END: &[u8] = b"end_header\n";
        let end = bytes.windows(END.len()).position(|w| w == END).expect("it has a header");
        let header = std::str::from_utf8(&bytes[..end]).expect("headers are text");
        let names = header.lines().filter_map(|line| line.strip_prefix("property float "));
        let names: Vec<String> = names.map(str::to_owned).collect();
        let floats =
            bytes[end + END.len()..].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b));
        let floats: Vec<f32> = floats.collect();
        let rows = floats.chunks_exact(names.len()).map(<[f32]>::to_vec).collect();
        Self { names, rows }
    }

    /// The header up to `end_header`, with properties of `kind` (`float`, `double` …).
    pub fn header(&self, format: &str, kind: &str) -> String {
        let lines = self.names.iter().map(|name| format!("property {kind} {name}\n"));
        let lines: String = lines.collect();
        format!("ply\nformat {format} 1.0\nelement vertex {}\n{lines}end_header\n", self.rows.len())
    }

    /// The file as programs write it: binary, little-endian.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = self.header("binary_little_endian", "float").into_bytes();
        bytes.extend(self.rows.iter().flatten().flat_map(|x| x.to_le_bytes()));
        bytes
    }

    /// The file as text.
    pub fn ascii(&self) -> String {
        let row = |row: &Vec<f32>| row.iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
        let rows: Vec<String> = self.rows.iter().map(row).collect();
        self.header("ascii", "float") + &rows.join("\n")
    }

    /// Degree of the harmonics.
    pub fn degree(&self) -> usize {
        let rest = self.names.iter().filter(|name| name.starts_with("f_rest_")).count();
        (0..=3).find(|d| 3 * ((d + 1) * (d + 1) - 1) == rest).expect("a degree from 0 to 3")
    }

    /// A Gaussian's number.
    ///
    /// # Panics
    ///
    /// Where there is none of this name.
    pub fn get(&self, row: &[f32], name: &str) -> f64 {
        let column = self.names.iter().position(|n| n == name);
        f64::from(row[column.unwrap_or_else(|| panic!("no property {name}"))])
    }

    /// Draws all Gaussians over `background`: (r, g, b) of each pixel, row-major.
    pub fn draw(&self, camera: &Camera, background: [f32; 3]) -> Vec<[f64; 3]> {
        let mut splats: Vec<Flat> =
            self.rows.iter().filter_map(|row| self.project(row, camera)).collect();
        splats.sort_by(|a, b| a.depth.total_cmp(&b.depth));
        let (width, height) = (camera.width as usize, camera.height as usize);
        let mut picture = vec![([0.0; 3], 1.0); width * height];
        for splat in &splats {
            let [x0, x1] = splat.reach(0, width);
            let [y0, y1] = splat.reach(1, height);
            for y in y0..y1 {
                for x in x0..x1 {
                    splat.blend(x, y, &mut picture[y * width + x]);
                }
            }
        }
        let over = |(color, t): ([f64; 3], f64)| {
            core::array::from_fn(|i| color[i] + t * f64::from(background[i]))
        };
        picture.into_iter().map(over).collect()
    }

    /// EWA splatting: Σ' = J W Σ Wᵀ Jᵀ + 0.3 I with Σ = R S S Rᵀ.
    fn project(&self, row: &[f32], camera: &Camera) -> Option<Flat> {
        let numbers = |names: [&str; 3]| names.map(|name| self.get(row, name));
        let center = numbers(["x", "y", "z"]);
        let world = camera.world_to_camera.map(|row| row.map(f64::from));
        let p: [f64; 3] =
            world.map(|[a, b, c, t]| a * center[0] + b * center[1] + c * center[2] + t);
        if p[2] < 0.01 {
            return None;
        }
        let q = ["rot_0", "rot_1", "rot_2", "rot_3"].map(|name| self.get(row, name));
        let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        let [w, x, y, z] = q.map(|c| c / length);
        let rotation = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let sigma = numbers(["scale_0", "scale_1", "scale_2"]).map(f64::exp);
        let focal = [f64::from(camera.fx), f64::from(camera.fy)];
        let size = [camera.width, camera.height].map(f64::from);
        let slope = |i: usize| {
            let limit = 1.3 * size[i] / (2.0 * focal[i]);
            (p[i] / p[2]).clamp(-limit, limit)
        };
        let jacobian = [
            [focal[0] / p[2], 0.0, -focal[0] * slope(0) / p[2]],
            [0.0, focal[1] / p[2], -focal[1] * slope(1) / p[2]],
        ];
        // Rows of J W R S.
        let axes = jacobian.map(|j| {
            let w: [f64; 3] = core::array::from_fn(|k| (0..3).map(|i| j[i] * world[i][k]).sum());
            let r = |k: usize| (0..3).map(|i| w[i] * rotation[i][k]).sum::<f64>();
            [0, 1, 2].map(|k| r(k) * sigma[k])
        });
        let covariance = |a: usize, b: usize| (0..3).map(|k| axes[a][k] * axes[b][k]).sum::<f64>();
        let (xx, xy, yy) = (covariance(0, 0) + 0.3, covariance(0, 1), covariance(1, 1) + 0.3);
        let det = xx * yy - xy * xy;
        let eye: [f64; 3] =
            core::array::from_fn(|k| -(0..3).map(|i| world[i][k] * world[i][3]).sum::<f64>());
        let ray: [f64; 3] = core::array::from_fn(|k| center[k] - eye[k]);
        let length = ray.iter().map(|x| x * x).sum::<f64>().sqrt();
        Some(Flat {
            mean: [
                focal[0] * p[0] / p[2] + f64::from(camera.cx),
                focal[1] * p[1] / p[2] + f64::from(camera.cy),
            ],
            variances: [xx, yy],
            inverse: [yy / det, -xy / det, xx / det],
            opacity: 1.0 / (1.0 + (-self.get(row, "opacity")).exp()),
            color: self.color(row, ray.map(|x| x / length)),
            depth: p[2],
        })
    }

    /// max(0, ½ + Σ coefficient · harmonic) as 3D Gaussian Splatting writes it out.
    fn color(&self, row: &[f32], [x, y, z]: [f64; 3]) -> [f64; 3] {
        let basis = [
            -0.488_602_511_902_919_9 * y,
            0.488_602_511_902_919_9 * z,
            -0.488_602_511_902_919_9 * x,
            1.092_548_430_592_079_2 * x * y,
            -1.092_548_430_592_079_2 * y * z,
            0.315_391_565_252_520_05 * (2.0 * z * z - x * x - y * y),
            -1.092_548_430_592_079_2 * x * z,
            0.546_274_215_296_039_6 * (x * x - y * y),
            -0.590_043_589_926_643_5 * y * (3.0 * x * x - y * y),
            2.890_611_442_640_554 * x * y * z,
            -0.457_045_799_464_465_8 * y * (4.0 * z * z - x * x - y * y),
            0.373_176_332_590_115_4 * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y),
            -0.457_045_799_464_465_8 * x * (4.0 * z * z - x * x - y * y),
            1.445_305_721_320_277 * z * (x * x - y * y),
            -0.590_043_589_926_643_5 * x * (x * x - 3.0 * y * y),
        ];
        let bands = (self.degree() + 1) * (self.degree() + 1) - 1;
        [0, 1, 2].map(|channel| {
            let constant = self.get(row, &format!("f_dc_{channel}"));
            let rest = basis[..bands].iter().enumerate().map(|(band, basis)| {
                basis * self.get(row, &format!("f_rest_{}", channel * bands + band))
            });
            (0.5 + 0.282_094_791_773_878_14 * constant + rest.sum::<f64>()).max(0.0)
        })
    }
}

/// A Gaussian on the screen, px.
struct Flat {
    mean: [f64; 2],
    variances: [f64; 2],
    /// xx, xy, yy of the inverse covariance.
    inverse: [f64; 3],
    opacity: f64,
    color: [f64; 3],
    depth: f64,
}

impl Flat {
    /// First pixel along an axis that may get an alpha of 1/255, and one past the last.
    fn reach(&self, axis: usize, len: usize) -> [usize; 2] {
        let log = (255.0 * self.opacity).ln();
        if log < 0.0 {
            return [0, 0];
        }
        let half = (2.0 * log * self.variances[axis]).sqrt();
        [self.mean[axis] - half, self.mean[axis] + half + 1.0]
            .map(|at| at.clamp(0.0, len as f64) as usize)
    }

    fn blend(&self, x: usize, y: usize, (color, transmittance): &mut ([f64; 3], f64)) {
        let (dx, dy) = (x as f64 + 0.5 - self.mean[0], y as f64 + 0.5 - self.mean[1]);
        let [a, b, c] = self.inverse;
        let alpha = (self.opacity * (-0.5 * (a * dx * dx + 2.0 * b * dx * dy + c * dy * dy)).exp())
            .min(0.99);
        if alpha < 1.0 / 255.0 || *transmittance < 1e-4 {
            return;
        }
        color.iter_mut().zip(self.color).for_each(|(sum, c)| *sum += *transmittance * alpha * c);
        *transmittance *= 1.0 - alpha;
    }
}
