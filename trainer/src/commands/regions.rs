//! Which parts of a mesh training tells apart.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::Result;
use dermis_trainer::embed::choice::{Choice, Mask};
use dermis_trainer::embed::regions::Region;

/// The regions, and how much they matter.
#[derive(clap::Args)]
pub(crate) struct RegionArguments {
    /// A part of the mesh with levels of its own, what no other takes being the last, named body: NAME=joints:A,B (and
    /// those below them), NAME=material:A,B or NAME=mask:IMG@CAM.json (as --detail-mask); repeatable, the first wins.
    #[arg(long, value_name = "NAME=CHOICE")]
    region: Vec<Named<Chosen>>,
    /// Times as many Gaussians on a region's area as its error asks for, of the same --gaussians, and the weight that
    /// the file tells; repeatable [default: 1; the file tells a weight by how much the region moves].
    #[arg(long, value_name = "NAME=X")]
    region_weight: Vec<Named<Weight>>,
}

/// Something of a region.
#[derive(Clone, Debug)]
struct Named<T> {
    region: String,
    value: T,
}

/// A choice of triangles, not yet read.
#[derive(Clone, Debug)]
enum Chosen {
    Joints(Vec<String>),
    Materials(Vec<String>),
    Mask { picture: PathBuf, camera: PathBuf },
}

#[derive(Clone, Copy, Debug)]
struct Weight(f32);

impl RegionArguments {
    /// Files that are read for them.
    pub(crate) fn files(&self) -> impl Iterator<Item = &Path> {
        self.region.iter().flat_map(|named| match &named.value {
            Chosen::Mask { picture, camera } => vec![picture.as_path(), camera.as_path()],
            Chosen::Joints(_) | Chosen::Materials(_) => Vec::new(),
        })
    }

    /// What they ask for; masks are read.
    pub(crate) fn regions(&self) -> Result<Vec<Region>> {
        for (index, Named { region, .. }) in self.region_weight.iter().enumerate() {
            if !self.region.iter().any(|named| named.region == *region) {
                super::misuse(&format!("--region-weight {region}: weigh what a --region names"));
            }
            if self.region_weight[..index].iter().any(|named| named.region == *region) {
                super::misuse(&format!("--region-weight {region}: is there twice; leave one out"));
            }
        }
        let weight = |region: &str| {
            let weight = self.region_weight.iter().find(|named| named.region == region);
            weight.map(|named| named.value.0)
        };
        let region = |Named { region, value }: &Named<Chosen>| {
            Ok(Region { name: region.clone(), choice: value.read()?, weight: weight(region) })
        };
        self.region.iter().map(region).collect()
    }
}

impl Chosen {
    fn read(&self) -> Result<Choice> {
        let mut choice = Choice::default();
        match self {
            Self::Joints(names) => choice.joints.clone_from(names),
            Self::Materials(names) => choice.materials.clone_from(names),
            Self::Mask { picture, camera } => choice.masks.push(Mask::load(picture, camera)?),
        }
        Ok(choice)
    }
}

impl<T: FromStr<Err = String>> FromStr for Named<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((region, value)) if !region.is_empty() => {
                Ok(Self { region: region.into(), value: value.parse()? })
            }
            _ => Err("start with the region's name, as in head=".into()),
        }
    }
}

impl FromStr for Chosen {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names = |list: &str| list.split(',').map(String::from).collect();
        match text.split_once(':') {
            Some(("joints", list)) if !list.is_empty() => Ok(Self::Joints(names(list))),
            Some(("material", list)) if !list.is_empty() => Ok(Self::Materials(names(list))),
            Some(("mask", files)) => match files.rsplit_once('@') {
                Some((picture, camera)) => {
                    Ok(Self::Mask { picture: picture.into(), camera: camera.into() })
                }
                None => Err("give the mask's camera, too, as in mask:face.png@camera.json".into()),
            },
            _ => Err("choose by joints:A,B, material:A,B or mask:IMG@CAM.json".into()),
        }
    }
}

impl FromStr for Weight {
    type Err = String;

    /// 0.01 to 100: more would leave nothing for the rest.
    fn from_str(text: &str) -> Result<Self, String> {
        let number = super::finite(text).ok().filter(|x| (0.01..=100.0).contains(x));
        number.map(Self).ok_or_else(|| "give a number from 0.01 to 100".into())
    }
}
