//! Meshes that are almost closed: faces turned alike, small holes capped.

use super::weld::Welded;
use glam::DVec3;
use std::collections::HashMap;

/// Caps of a larger share of a mesh's area than this are no mending: the mesh is open.
const SLIGHTLY: f64 = 0.1;

/// What was done to a mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Mended {
    /// Faces that were turned over.
    pub turned: usize,
    /// Holes that were capped.
    pub caps: usize,
}

/// Turns a mesh's faces alike and caps its holes; `None` where that makes no closed mesh, or the holes are large.
pub(super) fn mend(mesh: &Welded) -> Option<(Welded, Mended)> {
    let (mut triangles, turned) = alike(&mesh.triangles)?;
    let mut points = mesh.points.clone();
    let area = |points: &[DVec3], t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| points[v as usize]);
        0.5 * (b - a).cross(c - a).length()
    };
    let whole: f64 = triangles.iter().map(|t| area(&points, t)).sum();
    let holes = holes(&triangles)?;
    let mut capped = 0.0;
    for hole in &holes {
        let middle = hole.iter().map(|&v| points[v as usize]).sum::<DVec3>() / hole.len() as f64;
        let centre = points.len() as u32;
        points.push(middle);
        for (i, &a) in hole.iter().enumerate() {
            let cap = [a, hole[(i + 1) % hole.len()], centre];
            capped += area(&points, &cap);
            triangles.push(cap);
        }
    }
    (capped <= SLIGHTLY * whole).then_some((Welded { points, triangles }, Mended { turned, caps: holes.len() }))
}

/// The triangles, turned so that neighbours cross their common edge in opposite directions, and how many were turned (the fewer of each
/// connected piece). `None` where three or more meet at an edge, or no turning helps (a Möbius band).
fn alike(triangles: &[[u32; 3]]) -> Option<(Vec<[u32; 3]>, usize)> {
    let mut beside: HashMap<(u32, u32), Vec<(usize, bool)>> = HashMap::new();
    for (i, t) in triangles.iter().enumerate() {
        for (a, b) in edges(t) {
            beside.entry((a.min(b), a.max(b))).or_default().push((i, a < b));
        }
    }
    if beside.values().any(|faces| faces.len() > 2) {
        return None;
    }
    let mut turn: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut turned = 0;
    for first in 0..triangles.len() {
        if turn[first].is_some() {
            continue;
        }
        turn[first] = Some(false);
        let mut piece = vec![first];
        let mut next = 0;
        while let Some(&i) = piece.get(next) {
            next += 1;
            let mine = turn[i] == Some(true);
            for (a, b) in edges(&triangles[i]) {
                let Some([one, other]) = beside.get(&(a.min(b), a.max(b))).map(Vec::as_slice) else { continue };
                let ((_, way), (j, their)) = if one.0 == i { (*one, *other) } else { (*other, *one) };
                // Alike where they cross the edge in opposite directions.
                let wanted = mine ^ (way == their);
                match turn[j] {
                    None => {
                        turn[j] = Some(wanted);
                        piece.push(j);
                    }
                    Some(is) if is != wanted => return None,
                    Some(_) => {}
                }
            }
        }
        let over = piece.iter().filter(|&&i| turn[i] == Some(true)).count();
        // The few follow the many.
        let swap = 2 * over > piece.len();
        piece.iter().for_each(|&i| turn[i] = turn[i].map(|t| t ^ swap));
        turned += if swap { piece.len() - over } else { over };
    }
    let faced = triangles.iter().zip(turn).map(|(&[a, b, c], turn)| if turn == Some(true) { [a, c, b] } else { [a, b, c] });
    Some((faced.collect(), turned))
}

fn edges(&[a, b, c]: &[u32; 3]) -> [(u32, u32); 3] {
    [(a, b), (b, c), (c, a)]
}

/// The rims of the holes, each in the direction that caps run along it; `None` where rims touch.
fn holes(triangles: &[[u32; 3]]) -> Option<Vec<Vec<u32>>> {
    let all: std::collections::HashSet<(u32, u32)> = triangles.iter().flat_map(edges).collect();
    let mut next: HashMap<u32, u32> = HashMap::new();
    let mut starts = Vec::new();
    for t in triangles {
        for (a, b) in edges(t).into_iter().filter(|&(a, b)| !all.contains(&(b, a))) {
            if next.insert(b, a).is_some() {
                return None;
            }
            starts.push(b);
        }
    }
    let mut rims = Vec::new();
    for start in starts {
        let (mut rim, mut at) = (Vec::new(), start);
        while let Some(after) = next.remove(&at) {
            rim.push(at);
            at = after;
        }
        if at != start {
            return None;
        }
        if !rim.is_empty() {
            rims.push(rim);
        }
    }
    Some(rims)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of side 2 with each face split into 2 x 2 quads, without the first `missing` triangles.
    fn cube(missing: usize, turned: usize) -> Welded {
        let mut points: Vec<DVec3> = Vec::new();
        let mut triangles = Vec::new();
        let mut at = |p: DVec3| {
            let known = points.iter().position(|q| *q == p);
            known.unwrap_or_else(|| {
                points.push(p);
                points.len() - 1
            }) as u32
        };
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                for (u, v) in [(-1.0, -1.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 0.0)] {
                    let mut corner = |du: f64, dv: f64| {
                        let mut p = DVec3::ZERO;
                        p[axis] = side;
                        p[(axis + 1) % 3] = u + du;
                        p[(axis + 2) % 3] = v + dv;
                        at(p)
                    };
                    let [a, b, c, d] = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
                    triangles.extend(if side > 0.0 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
                }
            }
        }
        triangles.iter_mut().take(turned + missing).skip(missing).for_each(|t| t.swap(1, 2));
        triangles.drain(..missing);
        Welded { points, triangles }
    }

    #[test]
    fn closed_meshes_stay_as_they_are() {
        let (same, mended) = mend(&cube(0, 0)).unwrap();
        assert_eq!((same.triangles, mended), (cube(0, 0).triangles, Mended::default()));
    }

    #[test]
    fn turned_faces_are_turned_back_and_small_holes_capped() {
        for (missing, turned, caps) in [(0, 3, 0), (1, 0, 1), (2, 5, 1), (4, 1, 1)] {
            let (whole, mended) = mend(&cube(missing, turned)).unwrap();
            assert_eq!((mended, whole.open_edges()), (Mended { turned, caps }, 0));
            // Each triangle has an area of half a unit; its cap lies in the same plane, or cuts a corner.
            assert!((whole.signed_volume() - 8.0).abs() < 0.2, "{missing} {turned}: {}", whole.signed_volume());
        }
    }

    #[test]
    fn large_holes_and_fans_are_not_mended() {
        assert!(mend(&cube(8, 0)).is_none());
        // Two holes that touch at a corner.
        assert!(mend(&cube(3, 0)).is_none());
        let mut fan = cube(0, 0);
        let [a, b, _] = fan.triangles[0];
        fan.points.push(DVec3::splat(3.0));
        fan.triangles.push([a, b, fan.points.len() as u32 - 1]);
        assert!(mend(&fan).is_none());
    }
}
