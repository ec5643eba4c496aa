//! Triangles and skin as numbers that are easier to tell: in place, before columns are coded and after they are read.
//!
//! **Triangles** of u16 indices go from edge to edge, as in caches of vertices (Chhugani and Kumar 2007, Geometry Engine
//! Optimization: Cache Friendly Compressed Representation of Geometry): most share an edge with one of the last
//! [`EDGES`] / 2, and add a vertex that is new or one of the last [`RECENT`]. A mesh of a body takes 10 bits a triangle in
//! place of 17. **Skin**: the first weights of all vertices become what all four add up to, 255.

use crate::error::{Error, malformed};
use crate::section::tag;

/// Edges that a triangle may share, two or three of each triangle before it.
const EDGES: usize = 64;
/// Vertices, as codes named them.
const RECENT: usize = 64;
/// Codes of an edge, by which of the triangle's corners is not on it; codes of the first corner of all other triangles follow.
const OF_EDGES: u16 = 3 * EDGES as u16;
/// Codes of vertices that are new or recent; codes by their number follow.
const OF_RECENT: u16 = 1 + RECENT as u16;
/// With more vertices not every code fits in 16 bits.
const MOST_VERTICES: u32 = (1 << 16) - (OF_EDGES + OF_RECENT) as u32;

/// Makes codes of a section's indices or weights.
#[cfg(feature = "std")]
pub(super) fn to_codes(tag: [u8; 4], payload: &mut [u8], vertices: u32) {
    match tag {
        tag::TRIANGLES if vertices <= MOST_VERTICES => {
            let mut front = Front::new(vertices);
            for triangle in payload.as_chunks_mut::<6>().0 {
                *triangle = bytes(front.codes(shorts(triangle)));
            }
        }
        tag::SKIN => {
            for weights in weights(payload, vertices) {
                let [a, b, c, d] = *weights;
                weights[0] = a.wrapping_add(b).wrapping_add(c).wrapping_add(d);
            }
        }
        _ => {}
    }
}

/// The inverse.
///
/// # Errors
///
/// Where codes name an edge or a vertex that is not there.
pub(super) fn from_codes(tag: [u8; 4], payload: &mut [u8], vertices: u32) -> Result<(), Error> {
    match tag {
        tag::TRIANGLES if vertices <= MOST_VERTICES => {
            let mut front = Front::new(vertices);
            for triangle in payload.as_chunks_mut::<6>().0 {
                let Some(corners) = front.corners(shorts(triangle)) else {
                    return malformed("packed section", "a triangle is told by what is not there");
                };
                *triangle = bytes(corners);
            }
        }
        tag::SKIN => {
            for weights in weights(payload, vertices) {
                let [sum, b, c, d] = *weights;
                weights[0] = sum.wrapping_sub(b).wrapping_sub(c).wrapping_sub(d);
            }
        }
        _ => {}
    }
    Ok(())
}

/// The weights of each vertex: what stands behind the binds.
fn weights(payload: &mut [u8], vertices: u32) -> &mut [[u8; 4]] {
    let start = payload.len().saturating_sub((vertices as usize).saturating_mul(4));
    payload.get_mut(start..).unwrap_or_default().as_chunks_mut().0
}

fn shorts([a, b, c, d, e, f]: &[u8; 6]) -> [u16; 3] {
    [[*a, *b], [*c, *d], [*e, *f]].map(u16::from_le_bytes)
}

fn bytes(shorts: [u16; 3]) -> [u8; 6] {
    let [[a, b], [c, d], [e, f]] = shorts.map(u16::to_le_bytes);
    [a, b, c, d, e, f]
}

/// What triangles so far leave for the next one.
struct Front {
    vertices: u32,
    /// The least vertex above all that came.
    next: u32,
    edges: Last<[u16; 2], EDGES>,
    recent: Last<u16, RECENT>,
}

impl Front {
    fn new(vertices: u32) -> Self {
        Self { vertices, next: 0, edges: Last::new([0; 2]), recent: Last::new(0) }
    }

    /// The codes of a triangle.
    #[cfg(feature = "std")]
    fn codes(&mut self, [a, b, c]: [u16; 3]) -> [u16; 3] {
        // An edge is passed the other way by the triangle on its other side.
        let turns = [[a, b, c], [b, c, a], [c, a, b]];
        let shared = self.edges.iter().zip(0..).find_map(|(edge, age)| {
            let turn = turns.iter().position(|&[from, to, _]| edge == [to, from])?;
            Some((age, turn))
        });
        match shared {
            Some((age, turn)) => {
                let [from, to, apex] = turns[turn];
                self.pass(&[[to, apex], [apex, from]]);
                [3 * age + turn as u16, self.code(apex), 0]
            }
            None => {
                self.pass(&[[a, b], [b, c], [c, a]]);
                let first = OF_EDGES + self.code(a);
                [first, self.code(b), self.code(c)]
            }
        }
    }

    /// The corners that codes stand for.
    fn corners(&mut self, [first, second, third]: [u16; 3]) -> Option<[u16; 3]> {
        let Some(first) = first.checked_sub(OF_EDGES) else {
            let [to, from] = self.edges.get(usize::from(first / 3))?;
            if third != 0 {
                return None;
            }
            let apex = self.vertex(second)?;
            self.pass(&[[to, apex], [apex, from]]);
            return Some(match first % 3 {
                0 => [from, to, apex],
                1 => [apex, from, to],
                _ => [to, apex, from],
            });
        };
        let [a, b, c] = [self.vertex(first)?, self.vertex(second)?, self.vertex(third)?];
        self.pass(&[[a, b], [b, c], [c, a]]);
        Some([a, b, c])
    }

    fn pass(&mut self, edges: &[[u16; 2]]) {
        edges.iter().for_each(|&edge| self.edges.push(edge));
    }

    #[cfg(feature = "std")]
    fn code(&mut self, vertex: u16) -> u16 {
        let recent = || self.recent.iter().zip(1..).find(|&(recent, _)| recent == vertex);
        let code = if u32::from(vertex) == self.next {
            0
        } else if let Some((_, code)) = recent() {
            code
        } else {
            // How far below the next one, around the end.
            let below = self.next + self.vertices - 1 - u32::from(vertex);
            OF_RECENT + (below % self.vertices) as u16
        };
        self.see(vertex);
        code
    }

    fn vertex(&mut self, code: u16) -> Option<u16> {
        let vertex = match code.checked_sub(OF_RECENT) {
            Some(below) => {
                let last = self.vertices.checked_sub(1)?;
                let up = last.checked_sub(below.into())?;
                ((self.next + up) % self.vertices) as u16
            }
            None => match usize::from(code).checked_sub(1) {
                Some(age) => self.recent.get(age)?,
                None => self.next as u16,
            },
        };
        if u32::from(vertex) >= self.vertices {
            return None;
        }
        self.see(vertex);
        Some(vertex)
    }

    fn see(&mut self, vertex: u16) {
        self.next = self.next.max(u32::from(vertex) + 1);
        self.recent.push(vertex);
    }
}

/// The last `N` things of a row.
struct Last<T, const N: usize> {
    things: [T; N],
    pushed: usize,
}

impl<T: Copy, const N: usize> Last<T, N> {
    fn new(none: T) -> Self {
        Self { things: [none; N], pushed: 0 }
    }

    fn push(&mut self, thing: T) {
        if let Some(oldest) = self.things.get_mut(self.pushed % N) {
            *oldest = thing;
        }
        self.pushed = self.pushed.wrapping_add(1);
    }

    /// What came so many before the last one.
    fn get(&self, age: usize) -> Option<T> {
        let index = self.pushed.checked_sub(1 + age)?;
        if age < N { self.things.get(index % N).copied() } else { None }
    }

    /// From the last one on.
    #[cfg(feature = "std")]
    fn iter(&self) -> impl Iterator<Item = T> {
        (0..N).map_while(|age| self.get(age))
    }
}

#[cfg(all(test, feature = "std"))]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn payload(triangles: &[[u16; 3]]) -> Vec<u8> {
        triangles.iter().flat_map(|&corners| bytes(corners)).collect()
    }

    #[test]
    fn a_strip_is_told_by_its_edges() {
        let strip: Vec<[u16; 3]> = (0..100u16)
            .map(|i| if i % 2 == 0 { [i, i + 1, i + 2] } else { [i + 1, i, i + 2] })
            .collect();
        let mut codes = payload(&strip);
        to_codes(tag::TRIANGLES, &mut codes, 102);
        let (codes, rest) = codes.as_chunks::<6>();
        assert!(rest.is_empty());
        assert_eq!(shorts(&codes[0]), [OF_EDGES, 0, 0]);
        // Each shares the edge before the last one's, and its apex is new.
        assert!(codes[1..].iter().all(|code| shorts(code)[1..] == [0, 0]));
        assert!(codes[1..].iter().all(|code| shorts(code)[0] < 6));
    }

    fn return_of(triangles: &[[u16; 3]], vertices: u32) -> u16 {
        let before = payload(triangles);
        let mut after = before.clone();
        to_codes(tag::TRIANGLES, &mut after, vertices);
        let greatest = after.as_chunks::<6>().0.iter().flat_map(shorts).max();
        from_codes(tag::TRIANGLES, &mut after, vertices).unwrap();
        assert_eq!(after, before);
        greatest.unwrap_or(0)
    }

    #[test]
    fn the_specification_has_these_codes() {
        let spec = include_str!("../../SPEC.md");
        let (_, rest) = spec.split_once("by codes:\n\n```text\n").unwrap();
        let (line, _) = rest.split_once('\n').unwrap();
        let found: Vec<u16> = line.split_whitespace().map(|code| code.parse().unwrap()).collect();
        let mut codes = payload(&[[0, 1, 2], [2, 1, 3], [3, 1, 4], [0, 5, 3]]);
        to_codes(tag::TRIANGLES, &mut codes, 6);
        let codes: Vec<u16> = codes.as_chunks::<6>().0.iter().flat_map(shorts).collect();
        assert_eq!(codes, found);
    }

    #[test]
    fn the_greatest_code_has_all_bits() {
        // Vertex 0 as the first corner, told by its number from just below the last one.
        let others = (1..30u16).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        let last = MOST_VERTICES as u16 - 1;
        let triangles: Vec<[u16; 3]> =
            [[0, 1, last]].into_iter().chain(others).chain([[0, 2, 1]]).collect();
        assert_eq!(return_of(&triangles, MOST_VERTICES), u16::MAX);
        assert_eq!(return_of(&triangles, MOST_VERTICES + 1), last, "as they are");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn triangles_return(
            vertices in prop_oneof![1u32..300, MOST_VERTICES - 2..=1 << 16],
            seeds in prop::collection::vec([0u16.., 0.., 0..], 0..300),
            near in 1u32..200,
        ) {
            // Corners that are alike or near each other.
            let corner = |seed: u16, at: usize| (u32::from(seed) % near + at as u32) % vertices;
            let triangles: Vec<[u16; 3]> = seeds
                .iter()
                .enumerate()
                .map(|(at, seeds)| seeds.map(|seed| corner(seed, at) as u16))
                .collect();
            return_of(&triangles, vertices);
        }

        #[test]
        fn any_codes_give_vertices_or_an_error(
            vertices in 0u32..30,
            codes in prop::collection::vec(
                (prop_oneof![0..OF_EDGES, OF_EDGES..OF_EDGES + OF_RECENT + 40], 0..OF_RECENT + 40, 0u16..4),
                0..8,
            ),
        ) {
            let codes: Vec<[u16; 3]> = codes
                .into_iter()
                .map(|(first, second, third)| [first, second, if first < OF_EDGES { third / 3 } else { third }])
                .collect();
            let mut payload = payload(&codes);
            if from_codes(tag::TRIANGLES, &mut payload, vertices).is_ok() {
                let triangles = payload.as_chunks::<6>().0;
                let mut corners = triangles.iter().flat_map(shorts);
                prop_assert!(corners.all(|corner| u32::from(corner) < vertices));
            }
        }

        #[test]
        fn weights_return(mut payload in prop::collection::vec(0u8.., 0..100), vertices in 0u32..20) {
            let before = payload.clone();
            to_codes(tag::SKIN, &mut payload, vertices);
            from_codes(tag::SKIN, &mut payload, vertices).unwrap();
            prop_assert_eq!(payload, before);
        }
    }
}
