//! No circles inside a folder: what stands side by side has an order.
//!
//! The nodes are the files and folders of a folder. One points to another if any file in it names
//! something of the other by a path; a name that the face of the folder (`mod.rs`) takes from a file
//! is that file's. The face itself is no node: it may name all its files, and they what it defines.

use std::collections::{BTreeMap, BTreeSet};

use crate::source::{Source, sources};

type Graph = BTreeMap<String, BTreeSet<String>>;

/// The circles in a package, each as its folder and the nodes in their order.
pub(crate) fn circles(package: &str) -> Vec<String> {
    let sources = sources(package);
    let mut graphs = BTreeMap::<Vec<String>, Graph>::new();
    for source in &sources {
        for path in source.paths() {
            if let Some((folder, from, to)) = arrow(&sources, &source.module, &path) {
                let graph = graphs.entry(folder).or_default();
                graph.entry(from).or_default().insert(to);
            }
        }
    }
    let found = graphs.iter().filter_map(|(folder, graph)| {
        let circle = circle(graph)?;
        Some(format!(
            "{package}/{}: {}",
            folder.join("/"),
            circle.join(" -> ")
        ))
    });
    found.collect()
}

/// In which folder, from where to where a file of `module` points that names `path`.
fn arrow(
    sources: &[Source],
    module: &[String],
    path: &[String],
) -> Option<(Vec<String>, String, String)> {
    let common = (module.iter().zip(path))
        .take_while(|(x, y)| x == y)
        .count();
    let (folder, from, name) = (&module[..common], module.get(common)?, path.get(common)?);
    let is_node = |name: &str| {
        let inside = |source: &&Source| {
            source.module.starts_with(folder)
                && source.module.get(common).is_some_and(|x| x == name)
        };
        sources.iter().any(|source| inside(&source))
    };
    let to = if is_node(name) {
        name.clone()
    } else {
        let face = (sources.iter()).find(|source| source.is_face && source.module == folder)?;
        let taken = face.taken_names();
        let (_, node) = taken
            .into_iter()
            .find(|(taken, node)| taken == name && is_node(node))?;
        node
    };
    (*from != to).then(|| (folder.to_vec(), from.clone(), to))
}

/// A circle, if there is one, by following arrows until a node comes again.
fn circle(graph: &Graph) -> Option<Vec<String>> {
    let mut sound = BTreeSet::new();
    graph
        .keys()
        .find_map(|start| follow(graph, start, &mut Vec::new(), &mut sound))
}

fn follow(
    graph: &Graph,
    node: &str,
    way: &mut Vec<String>,
    sound: &mut BTreeSet<String>,
) -> Option<Vec<String>> {
    if let Some(at) = way.iter().position(|passed| passed == node) {
        let mut circle = way[at..].to_vec();
        circle.push(node.to_owned());
        return Some(circle);
    }
    if sound.contains(node) {
        return None;
    }
    way.push(node.to_owned());
    for next in graph.get(node).into_iter().flatten() {
        if let Some(circle) = follow(graph, next, way, sound) {
            return Some(circle);
        }
    }
    way.pop();
    sound.insert(node.to_owned());
    None
}

#[test]
fn a_circle_is_found_however_long() {
    let graph = |arrows: &[(&str, &str)]| {
        let mut graph = Graph::new();
        for (from, to) in arrows {
            graph
                .entry((*from).into())
                .or_default()
                .insert((*to).into());
        }
        graph
    };
    assert_eq!(circle(&graph(&[("a", "b"), ("a", "c"), ("b", "c")])), None);
    let round = circle(&graph(&[("a", "b"), ("b", "c"), ("c", "d"), ("d", "b")]));
    assert_eq!(round.expect("b to d"), ["b", "c", "d", "b"]);
}
