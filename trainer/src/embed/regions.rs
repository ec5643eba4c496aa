//! The mesh cut into regions, each with a nested order of its own, so that a plan can give more to one than to
//! another (face-lod, 4.1.1).

use anyhow::{Context, Result, ensure};
use dermis_format::header::MAX_REGIONS;

use super::choice::Choice;
use crate::model::Model;
use crate::optimize::cloud::Seed;

/// The region of all triangles that no other takes.
pub const BODY: &str = "body";
/// Bytes of a name, at most.
const LONGEST_NAME: usize = 255;

/// A region that is asked for.
#[derive(Clone, Debug)]
pub struct Region {
    /// Its name, not [`BODY`].
    pub name: String,
    /// Its triangles, but for those of regions before it.
    pub choice: Choice,
    /// Times as many Gaussians on an area as the error alone asks for, relative to regions without a weight.
    pub weight: Option<f32>,
}

/// A mesh cut into regions: those asked for in their order, then [`BODY`] if any triangle is left.
#[derive(Clone, Debug)]
pub struct Regions {
    /// Name of each.
    pub names: Vec<String>,
    /// Weight of each, where one is given.
    pub weights: Vec<Option<f32>>,
    /// Index of each triangle's.
    pub of_triangles: Vec<u8>,
}

impl Regions {
    /// Cuts a mesh.
    ///
    /// # Errors
    /// Where a name is not one or is taken, a choice fails ([`Choice::select`]), no triangle is left for a region, or
    /// they are more than a file can hold.
    pub fn cut(model: &Model, asked: &[Region]) -> Result<Self> {
        let mut regions = Self {
            names: Vec::new(),
            weights: Vec::new(),
            of_triangles: vec![u8::MAX; model.triangles.len()],
        };
        for Region { name, choice, weight } in asked {
            ensure!(
                (1..=LONGEST_NAME).contains(&name.len()),
                "a region's name has {} bytes; give it 1 to {LONGEST_NAME}",
                name.len()
            );
            ensure!(name != BODY, "region {BODY}: is what others leave; choose another name");
            ensure!(!regions.names.contains(name), "region {name}: is there twice; rename one");
            let chosen = choice.select(model).with_context(|| format!("region {name}"))?;
            regions.add(name, *weight, |triangle| chosen[triangle])?;
        }
        if regions.of_triangles.contains(&u8::MAX) {
            regions.add(BODY, None, |_| true)?;
        }
        Ok(regions)
    }

    /// Adds what is `chosen` of the triangles that are left.
    fn add(
        &mut self,
        name: &str,
        weight: Option<f32>,
        chosen: impl Fn(usize) -> bool,
    ) -> Result<()> {
        let index = self.names.len();
        ensure!(
            index < MAX_REGIONS,
            "region {name}: would be one more than {MAX_REGIONS}; leave one out, or join some"
        );
        let left = self.of_triangles.iter_mut().enumerate();
        let mut taken =
            left.filter(|(triangle, of)| **of == u8::MAX && chosen(*triangle)).peekable();
        ensure!(
            taken.peek().is_some(),
            "region {name}: regions before it take all its triangles; name it before them"
        );
        taken.for_each(|(_, of)| *of = index as u8);
        self.names.push(name.to_owned());
        self.weights.push(weight);
        Ok(())
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there are none: there is no mesh.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// Multiplies the density wanted on each triangle by the weight of its region.
    pub fn thicken(&self, densities: &mut [f32]) {
        for (density, &region) in densities.iter_mut().zip(&self.of_triangles) {
            *density *= self.weights[usize::from(region)].unwrap_or(1.0);
        }
    }

    /// The seeds of each region, in the order that they had. Of points that are evenly spread over the mesh the same
    /// share of all regions is so, too.
    pub fn split(&self, seeds: &[Seed]) -> Vec<Vec<Seed>> {
        let mut split = vec![Vec::new(); self.len()];
        for seed in seeds {
            split[usize::from(self.of_triangles[seed.triangle as usize])].push(*seed);
        }
        split
    }

    /// Sums over the triangles of each region, as shares of the sum over all; 0 where that is 0.
    pub(super) fn shares(&self, of_triangles: impl Iterator<Item = f64>) -> Vec<f32> {
        let mut sums = vec![0.0; self.len()];
        for (x, &region) in of_triangles.zip(&self.of_triangles) {
            sums[usize::from(region)] += x;
        }
        let all: f64 = sums.iter().sum();
        sums.iter().map(|sum| if all > 0.0 { (sum / all).min(1.0) as f32 } else { 0.0 }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demo::demo_avatar;

    fn joints(name: &str, joints: &[&str]) -> Region {
        let joints = joints.iter().map(|&joint| joint.to_owned()).collect();
        let choice = Choice { joints, ..Choice::default() };
        Region { name: name.into(), choice, weight: None }
    }

    fn complaint(asked: &[Region]) -> String {
        format!("{:#}", Regions::cut(&demo_avatar(), asked).expect_err("it cannot be cut"))
    }

    #[test]
    fn the_first_takes_what_is_left_to_it() {
        let model = demo_avatar();
        let whole = Regions::cut(&model, &[]).expect("nothing is asked");
        assert_eq!((whole.names, whole.weights), (vec![BODY.to_owned()], vec![None]));
        assert!(whole.of_triangles.iter().all(|&region| region == 0));
        let cut = Regions::cut(&model, &[joints("head", &["head"]), joints("neck", &["neck"])]);
        let cut = cut.expect("both have triangles");
        assert_eq!(cut.names, ["head", "neck", BODY]);
        let count = |of: &[u8], region| of.iter().filter(|&&other| other == region).count();
        let head = joints("", &["head"]).choice.select(&model).expect("it is there");
        assert!(head.iter().zip(&cut.of_triangles).all(|(&head, &of)| head == (of == 0)));
        let lens: Vec<usize> = (0..3).map(|region| count(&cut.of_triangles, region)).collect();
        assert!(lens.iter().all(|&len| len > 0));
        assert_eq!(lens.iter().sum::<usize>(), model.triangles.len());
        let all = Regions::cut(&model, &[joints("all", &["root"])]).expect("all of it");
        assert_eq!(all.names, ["all"], "nothing is left for a body");
    }

    #[test]
    fn mistakes_are_told() {
        let head = || joints("head", &["head"]);
        let twice = complaint(&[head(), joints("head", &["hand_left"])]);
        assert_eq!(twice, "region head: is there twice; rename one");
        let taken = complaint(&[joints("upper", &["neck"]), head()]);
        assert!(taken.starts_with("region head: regions before it take all"), "{taken}");
        let unknown = complaint(&[joints("hand", &["Hand-Left"])]);
        assert_eq!(unknown, "region hand: has no joint Hand-Left; choose one of: hand_left");
        assert!(complaint(&[joints("body", &["head"])]).contains("choose another name"));
        assert!(complaint(&[joints("", &["head"])]).contains("give it 1 to 255"));
    }

    #[test]
    fn more_than_a_file_can_hold_are_refused() {
        // A material for each triangle of the first ones.
        let mut model = demo_avatar();
        let material = model.materials[0].clone();
        for index in 0..MAX_REGIONS {
            model
                .materials
                .push(crate::model::Material { name: index.to_string(), ..material.clone() });
            model.triangles[index].material = index as u32 + 1;
        }
        let asked: Vec<Region> = (0..MAX_REGIONS)
            .map(|index| {
                let choice = Choice { materials: vec![index.to_string()], ..Choice::default() };
                Region { name: index.to_string(), choice, weight: None }
            })
            .collect();
        let fits = Regions::cut(&model, &asked[1..]).expect("32 with the body");
        assert_eq!(fits.len(), MAX_REGIONS);
        let error = Regions::cut(&model, &asked).expect_err("33");
        assert!(error.to_string().contains("region body: would be one more than 32"), "{error}");
    }
}
