//! The checked view of an avatar's bytes.

use crate::block::Block;
use crate::curves::Curves;
use crate::error::{Error, malformed};
use crate::header::{Header, MAX_REGIONS, PerLevel};
use crate::level::Level;
use crate::level_order::LevelOrder;
use crate::mesh_levels::MeshLevels;
use crate::movement::Movements;
use crate::names::Names;
use crate::record::{
    BindRecord, ImportanceRecord, Indices, JointRecord, KeyFrameRecord, U32, VertexRecord, plane,
};
use crate::rig::{Clip, MorphTarget};
use crate::samples::Samples;
use crate::section::{self, Section, Sections, head, section_crc, split_header, tag};
use crate::walk::{Levels, Runs};

/// An avatar, read in place. Everything was checked by [`Avatar::parse`]; accessors are total.
#[derive(Clone, Copy, Debug)]
pub struct Avatar<'a> {
    header: Header,
    bytes: &'a [u8],
    sections: Sections<'a>,
    vertices: &'a [VertexRecord],
    bind_indices: Indices<'a>,
    bind_weights: &'a [[u8; 4]],
    corners: Indices<'a>,
    sides: &'a [u8],
    mesh_levels: MeshLevels<'a>,
    triangle_regions: &'a [u8],
    regions: &'a [u8],
    layers: &'a [U32],
    importances: &'a [ImportanceRecord],
    curves: Option<Curves<'a>>,
    samples: Option<Samples<'a>>,
    movements: Option<Movements<'a>>,
    joints: &'a [JointRecord],
    joint_names: &'a [u8],
    binds: &'a [BindRecord],
    key_frames: &'a [KeyFrameRecord],
    /// Gaussians of each region whose blocks are there.
    present: [u32; MAX_REGIONS],
}

impl<'a> Avatar<'a> {
    /// Checks the whole file: lengths, checksums, indices and numbers. Costs one pass over the bytes.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, Error> {
        let Scanned { avatar, counts, cut } = Scanned::new(bytes)?;
        if let Some(error) = cut {
            return Err(error);
        }
        if let Some(place) = avatar.incomplete(&counts) {
            return malformed(place, MISSING);
        }
        counts.levels.as_ref().map_or(Ok(()), LevelOrder::end)?;
        avatar.check(&counts)?;
        if counts.clips != usize::from(avatar.header.clips) {
            return malformed("CLIP", MISSING);
        }
        let regions = 0..usize::from(avatar.header.regions);
        if regions.clone().any(|region| avatar.region_len(region) != avatar.present(region)) {
            return malformed("LAYR", "the layers of a region do not add up to its blocks");
        }
        Ok(avatar)
    }

    /// The same of the first bytes of a file, cut anywhere behind the mesh and the rig: a coarser avatar, of the
    /// Gaussians and clips whose sections are whole. What follows the last whole section is left out.
    ///
    /// Lengths of regions and layers stay the file's; [`Self::present`] says what is there.
    pub fn parse_prefix(bytes: &'a [u8]) -> Result<Self, Error> {
        let Scanned { avatar, counts, cut } = Scanned::new(bytes)?;
        if let Some(place) = avatar.incomplete(&counts) {
            // It is behind the cut, or behind the end.
            let present = bytes.len() as u64;
            return Err(cut.unwrap_or(Error::Truncated { place, needed: present + 1, present }));
        }
        avatar.check(&counts)?;
        Ok(avatar)
    }

    fn without_sections(header: Header, bytes: &'a [u8], sections: Sections<'a>) -> Self {
        Self {
            header,
            bytes,
            sections,
            vertices: &[],
            bind_indices: Indices::Byte(&[]),
            bind_weights: &[],
            corners: Indices::Short(&[]),
            sides: &[],
            mesh_levels: MeshLevels::of_one(header.triangles),
            triangle_regions: &[],
            regions: &[],
            layers: &[],
            importances: &[],
            curves: None,
            samples: None,
            movements: None,
            joints: &[],
            joint_names: &[],
            binds: &[],
            key_frames: &[],
            present: [0; MAX_REGIONS],
        }
    }

    fn take(
        &mut self,
        Section { tag, payload }: Section<'a>,
        here: Sections<'a>,
        counts: &mut Counts<'a>,
    ) -> Result<(), Error> {
        let header = self.header;
        let place = section::name(tag);
        let split = match tag {
            tag::VERTICES => plane(payload).map(|plane| self.vertices = plane),
            tag::SKIN => self.take_skin(payload),
            tag::TRIANGLES => self.take_triangles(payload),
            tag::SIDES => (payload.len() == (header.triangles as usize).div_ceil(8))
                .then(|| self.sides = payload),
            tag::MESH_LEVELS => {
                MeshLevels::split(payload, &header).map(|levels| self.mesh_levels = levels)
            }
            tag::TRIANGLE_REGIONS => {
                let valid = payload.len() == header.triangles as usize
                    && payload.iter().all(|&r| r < header.regions);
                valid.then(|| self.triangle_regions = payload)
            }
            tag::REGIONS => {
                self.regions = payload;
                Names::of(payload).is_whole(header.regions.into()).then_some(())
            }
            tag::LAYERS => plane(payload).map(|plane| self.layers = plane),
            tag::IMPORTANCES => plane(payload).and_then(|plane| {
                self.importances = plane;
                let whole = plane.len() == usize::from(header.regions);
                (whole && plane.iter().all(ImportanceRecord::is_valid)).then_some(())
            }),
            tag::CURVES => {
                self.curves = Curves::split(payload, &header);
                self.curves.map(|_| ())
            }
            tag::SAMPLES => {
                self.samples = Samples::split(payload, &header);
                self.samples.map(|_| ())
            }
            tag::MOVEMENTS => {
                self.movements = Movements::split(payload, &header);
                self.movements.map(|_| ())
            }
            tag::JOINTS => plane(payload).map(|plane| self.joints = plane),
            tag::JOINT_NAMES => {
                self.joint_names = payload;
                Names::of(payload).is_whole(header.joints.into()).then_some(())
            }
            tag::BINDS => plane(payload).map(|plane| self.binds = plane),
            tag::KEY_FRAMES => plane(payload).map(|plane| self.key_frames = plane),
            tag::MORPH => MorphTarget::split(payload, header.vertices).and_then(|target| {
                counts.morph_targets += 1;
                let numbers = target.step.abs() <= 1e6 && target.default_weight.abs() <= 1e6;
                (numbers && target.vertices.iter().all(|v| v < header.vertices)).then_some(())
            }),
            tag::CLIP => Clip::split(payload).and_then(|clip| {
                counts.clips += 1;
                clip.is_valid(header.joints, header.morph_targets).then_some(())
            }),
            tag::BLOCK => {
                let Some(block) = Block::split(payload, &header) else {
                    return malformed(place, "its length does not fit its contents");
                };
                block.check(&header)?;
                return counts.add(&block);
            }
            tag::LEVEL | tag::SHAPE => {
                let Some(levels) = &mut counts.levels else {
                    return malformed(place, "the header says that there are none");
                };
                let Some(level) = Level::split(Section { tag, payload }) else {
                    return malformed(place, "its length does not fit its contents");
                };
                level.check(&header)?;
                return levels.level(&level, here);
            }
            _ => Some(()),
        };
        split
            .map_or_else(|| malformed(place, "its length or its numbers do not fit the header"), Ok)
    }

    fn take_skin(&mut self, payload: &'a [u8]) -> Option<()> {
        let n = self.header.vertices as usize;
        let (indices, rest) = Indices::take_binds(payload, n.checked_mul(4)?, self.header.binds)?;
        let weights = plane(rest)?;
        let in_range = indices.iter().all(|bind| bind < u32::from(self.header.binds));
        (self.bind_indices, self.bind_weights) = (indices, weights);
        (weights.len() == n && in_range).then_some(())
    }

    fn take_triangles(&mut self, payload: &'a [u8]) -> Option<()> {
        let n = (self.header.triangles as usize).checked_mul(3)?;
        let (corners, rest) = Indices::take_vertices(payload, n, self.header.vertices)?;
        self.corners = corners;
        (rest.is_empty() && corners.iter().all(|vertex| vertex < self.header.vertices))
            .then_some(())
    }

    /// A part of mesh, rig or regions that is not there, or not as long as the header says.
    fn incomplete(&self, counts: &Counts<'_>) -> Option<&'static str> {
        let header = &self.header;
        let layers = usize::from(header.regions) * usize::from(header.layers);
        let lengths = [
            (self.vertices.len(), header.vertices as usize, "VERT"),
            (self.corners.len() / 3, header.triangles as usize, "TRIS"),
            (
                self.bind_weights.len(),
                if header.binds > 0 { header.vertices as usize } else { 0 },
                "SKIN",
            ),
            (self.joints.len(), usize::from(header.joints), "JNTS"),
            (self.binds.len(), usize::from(header.binds), "BIND"),
            (self.layers.len(), layers, "LAYR"),
            (Names::of(self.regions).count(), usize::from(header.regions), "REGN"),
            (counts.morph_targets, usize::from(header.morph_targets), "MRPH"),
        ];
        let other = lengths.into_iter().find(|(found, expected, _)| found != expected);
        other.map(|(_, _, place)| place)
    }

    /// Whether all parts that are there fit each other.
    fn check(&self, counts: &Counts<'_>) -> Result<(), Error> {
        if counts.clips > usize::from(self.header.clips) {
            return malformed("CLIP", "there are more than the header says");
        }
        self.check_rig()?;
        self.check_layers()?;
        self.check_open_level(counts)
    }

    fn check_rig(&self) -> Result<(), Error> {
        for (index, joint) in self.joints.iter().enumerate() {
            let parent = joint.parent.get();
            if parent != u16::MAX && usize::from(parent) >= index {
                return malformed("JNTS", "a joint stands before its parent");
            }
            let numbers = joint.translation.iter().chain(&joint.rotation).chain(&joint.scale);
            if numbers.into_iter().any(|x| x.get().is_nan() || x.get().abs() > 1e12) {
                return malformed("JNTS", "a rest transform is not finite");
            }
        }
        for bind in self.binds {
            if bind.joint.get() >= self.header.joints {
                return malformed("BIND", "its joint does not exist");
            }
            if bind.inverse.iter().flatten().any(|x| x.get().is_nan() || x.get().abs() > 1e12) {
                return malformed("BIND", "a matrix is not finite");
            }
        }
        let clips = self.header.clips;
        if self.key_frames.iter().any(|k| k.clip.get() != u16::MAX && k.clip.get() >= clips) {
            return malformed("KEYF", "a key frame's clip does not exist");
        }
        if self.key_frames.iter().any(|k| !(0.0..=1e6).contains(&k.seconds.get())) {
            return malformed("KEYF", "a key frame's time is not in 0 to 1e6 seconds");
        }
        Ok(())
    }

    fn check_layers(&self) -> Result<(), Error> {
        let mut total = 0u64;
        for region in 0..usize::from(self.header.regions) {
            let layers = 0..usize::from(self.header.layers);
            let sum: u64 = layers.map(|layer| u64::from(self.layer_len(region, layer))).sum();
            if sum < u64::from(self.present(region)) {
                return malformed("LAYR", "the layers of a region do not add up to its blocks");
            }
            total += sum;
        }
        if total != u64::from(self.header.gaussians) {
            return malformed("header", "the number of Gaussians is not that of the layers");
        }
        for block in self.blocks() {
            let region = usize::from(block.region);
            let start: u64 =
                (0..usize::from(block.layer)).map(|l| u64::from(self.layer_len(region, l))).sum();
            let end = start + u64::from(self.layer_len(region, usize::from(block.layer)));
            let last = u64::from(block.first) + u64::from(block.count);
            if u64::from(block.first) < start || last > end {
                return malformed("block", "it crosses the border of its layer");
            }
        }
        Ok(())
    }

    /// Where a prefix ends among the levels of a layer, the blocks before them end where that layer starts.
    fn check_open_level(&self, counts: &Counts<'_>) -> Result<(), Error> {
        let Some((region, level)) = counts.levels.as_ref().and_then(LevelOrder::open) else {
            return Ok(());
        };
        let (region, level) = (usize::from(region), usize::from(level));
        let start: u64 = (0..level).map(|l| u64::from(self.layer_len(region, l))).sum();
        if u64::from(self.present(region)) != start || self.layer_len(region, level) == 0 {
            return malformed("LEVL", "no block of its level can follow");
        }
        Ok(())
    }

    /// What the file says of itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The whole file.
    pub fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Bind-space positions as codes.
    pub fn vertices(&self) -> &'a [VertexRecord] {
        self.vertices
    }

    /// Bind-space position of vertex `index`, metres; the origin for an index out of range.
    #[inline]
    pub fn vertex_position(&self, index: usize) -> [f32; 3] {
        let Some(record) = self.vertices.get(index) else { return [0.0; 3] };
        core::array::from_fn(|i| {
            self.header.position_min[i]
                + f32::from(record.position[i].get()) * self.header.position_step[i]
        })
    }

    /// Influences of vertex `index`: bind and weight in 1/255.
    #[inline]
    pub fn influences(&self, index: usize) -> [(u32, u8); 4] {
        let weights = self.bind_weights.get(index).copied().unwrap_or([0; 4]);
        core::array::from_fn(|i| {
            (self.bind_indices.get(index.saturating_mul(4).saturating_add(i)), weights[i])
        })
    }

    /// Corners of triangle `index`: indices of vertices.
    #[inline]
    pub fn triangle(&self, index: usize) -> [u32; 3] {
        core::array::from_fn(|i| self.corners.get(index.saturating_mul(3).saturating_add(i)))
    }

    /// Whether the back of triangle `index` is seen, so that it must be drawn.
    #[inline]
    pub fn is_two_sided(&self, index: usize) -> bool {
        self.sides.get(index / 8).is_some_and(|byte| byte >> (index % 8) & 1 == 1)
    }

    /// [`Self::is_two_sided`] of triangles 16 · `index` and following, the first in the lowest bit.
    #[inline]
    pub fn two_sided_of_sixteen(&self, index: usize) -> u16 {
        let byte = |at: usize| self.sides.get(at).copied().unwrap_or(0);
        let at = index.saturating_mul(2);
        u16::from_le_bytes([byte(at), byte(at.saturating_add(1))])
    }

    /// Region of triangle `index`.
    pub fn triangle_region(&self, index: usize) -> u8 {
        self.triangle_regions.get(index).copied().unwrap_or(0)
    }

    /// Names of the regions.
    pub fn region_names(&self) -> Names<'a> {
        Names::of(self.regions)
    }

    /// Gaussians of layer `layer` of region `region`.
    pub fn layer_len(&self, region: usize, layer: usize) -> u32 {
        let layers = usize::from(self.header.layers);
        let at = region.saturating_mul(layers).saturating_add(layer);
        self.layers.get(at).filter(|_| layer < layers).map_or(0, |len| len.get())
    }

    /// Gaussians of region `region`.
    pub fn region_len(&self, region: usize) -> u32 {
        (0..usize::from(self.header.layers)).map(|layer| self.layer_len(region, layer)).sum()
    }

    /// Gaussians of region `region` whose blocks are there: all of them, but in a prefix of a file.
    pub fn present(&self, region: usize) -> u32 {
        self.present.get(region).copied().unwrap_or(0)
    }

    /// How much each region matters, as measured when it was trained; none if the file leaves it out.
    pub fn importances(&self) -> &'a [ImportanceRecord] {
        self.importances
    }

    /// Importance weight of region `region`, in 0..=1000; 1 if the file leaves it out.
    pub fn region_weight(&self, region: usize) -> f32 {
        self.importances.get(region).map_or(1.0, |importance| importance.weight.get())
    }

    /// Which triangles are the surface's, and which those of coarser meshes.
    pub fn mesh_levels(&self) -> MeshLevels<'a> {
        self.mesh_levels
    }

    /// How near each region's picture is to the mesh; none if the file leaves it out.
    pub fn curves(&self) -> Option<Curves<'a>> {
        self.curves
    }

    /// Which triangles stand for the others where footprints are found; none if the file leaves it out.
    pub fn samples(&self) -> Option<Samples<'a>> {
        self.samples
    }

    /// How far joints and morph targets move the mesh; none if the file leaves it out.
    pub fn movements(&self) -> Option<Movements<'a>> {
        self.movements
    }

    /// The skeleton; parents stand before their children.
    pub fn joints(&self) -> &'a [JointRecord] {
        self.joints
    }

    /// Names of the joints; none if the file leaves them out.
    pub fn joint_names(&self) -> Names<'a> {
        Names::of(self.joint_names)
    }

    /// Inverse bind matrices.
    pub fn binds(&self) -> &'a [BindRecord] {
        self.binds
    }

    /// Key frames that the avatar was trained on.
    pub fn key_frames(&self) -> &'a [KeyFrameRecord] {
        self.key_frames
    }

    /// Morph targets in order.
    pub fn morph_targets(&self) -> impl Iterator<Item = MorphTarget<'a>> {
        let vertices = self.header.vertices;
        self.tagged(tag::MORPH).filter_map(move |payload| MorphTarget::split(payload, vertices))
    }

    /// Clips in order.
    pub fn clips(&self) -> impl Iterator<Item = Clip<'a>> {
        self.tagged(tag::CLIP).filter_map(Clip::split)
    }

    /// Blocks in the order of the file: coarse to fine.
    pub fn blocks(&self) -> impl Iterator<Item = Block<'a>> {
        let header = self.header;
        self.tagged(tag::BLOCK).filter_map(move |payload| Block::split(payload, &header))
    }

    /// Blocks' Gaussians at later levels, in the order of the file.
    pub fn levels(&self) -> impl Iterator<Item = Level<'a>> {
        self.sections.filter_map(Level::split)
    }

    /// Blocks in the order of the file, those of a region with the records that their Gaussians have where its
    /// levels say; those of later layers as they are. Without parameters per level: [`Self::blocks`].
    /// Takes 4 KB of stack, and a pass over the heads of all sections before the first block.
    pub fn blocks_at(&self, levels: impl Fn(u8) -> Levels) -> impl Iterator<Item = Block<'a>> {
        let has_levels = self.header.per_level == PerLevel::All;
        let mut runs = has_levels.then(|| Runs::find(self.sections, &levels));
        self.blocks().map(move |block| match &mut runs {
            Some(runs) => runs.at(block, levels(block.region)),
            None => block,
        })
    }

    /// Sections in the order of the file.
    pub fn sections(&self) -> Sections<'a> {
        self.sections
    }

    fn tagged(&self, tag: [u8; 4]) -> impl Iterator<Item = &'a [u8]> {
        self.sections.filter(move |section| section.tag == tag).map(|section| section.payload)
    }
}

/// What is said of a section that is not there, or cut.
const MISSING: &str = "it is missing or not as long as the header says";

/// A file's sections, each checked by itself.
struct Scanned<'a> {
    /// Of the whole sections.
    avatar: Avatar<'a>,
    counts: Counts<'a>,
    /// Why the last section is not whole, if it is not.
    cut: Option<Error>,
}

impl<'a> Scanned<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, Error> {
        let (header_bytes, rest) = split_header(bytes)?;
        let header = Header::parse(header_bytes)?;
        let start = bytes.len() - rest.len();
        let mut avatar = Avatar::without_sections(header, bytes, Sections::new(rest));
        let mut counts = Counts::new(&avatar);
        let (mut sections, mut end, mut cut) = (avatar.sections, start, None);
        loop {
            let here = sections;
            let (section, crc) = match sections.next_with_crc() {
                Some(Ok(section)) => section,
                Some(Err(error)) => {
                    cut = Some(error);
                    break;
                }
                None => break,
            };
            if crc != section_crc(&section) {
                return Err(Error::Damaged { place: section::name(section.tag) });
            }
            avatar.take(section, here, &mut counts)?;
            end += head::LEN + section.payload.len();
        }
        avatar.present = counts.regions;
        avatar.bytes = bytes.get(..end).unwrap_or(bytes);
        avatar.sections = Sections::new(bytes.get(start..end).unwrap_or(rest));
        Ok(Self { avatar, counts, cut })
    }
}

/// What was counted on the way through the sections.
struct Counts<'a> {
    morph_targets: usize,
    clips: usize,
    regions: [u32; MAX_REGIONS],
    /// Where there may be levels.
    levels: Option<LevelOrder<'a>>,
}

impl<'a> Counts<'a> {
    fn new(avatar: &Avatar<'a>) -> Self {
        let has_levels = avatar.header.per_level == PerLevel::All;
        Self {
            morph_targets: 0,
            clips: 0,
            regions: [0; MAX_REGIONS],
            levels: has_levels.then(|| LevelOrder::new(avatar.sections)),
        }
    }

    /// Blocks of a region follow each other without gaps.
    fn add(&mut self, block: &Block<'_>) -> Result<(), Error> {
        let Some(next) = self.regions.get_mut(usize::from(block.region)) else {
            return malformed("block", "its region does not exist");
        };
        match next.checked_add(block.count) {
            Some(sum) if block.first == *next => *next = sum,
            _ => return malformed("block", "it does not follow the block before it"),
        }
        self.levels.as_mut().map_or(Ok(()), |levels| levels.block(block))
    }
}
