//! The data to download for the sequences of the paper: who publishes them, and where they must be put.

/// Data as their authors publish them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Download {
    /// Folders in DATA.
    pub folders: &'static [&'static str],
    /// The sequences that are made from it.
    pub sequences: &'static [&'static str],
    /// Its name where it is published.
    pub what: &'static str,
    /// The size of the download.
    pub size: &'static str,
    /// The page or file to download.
    pub url: &'static str,
    /// How to put it into its place.
    pub how: &'static str,
}

const TUM: &str = "unpack the archive in DATA; rgb.txt, groundtruth.txt and rgb/ are used, and depth.txt and depth/ \
     if they are there";
const IMAGES: &str = "https://cvg.cit.tum.de/rgbd/dataset/freiburg3/";

/// Everything to download.
pub const DOWNLOADS: &[Download] = &[
    Download {
        folders: &["rgbd_dataset_freiburg3_long_office_household"],
        sequences: &["01", "06"],
        what: "TUM RGB-D, fr3/long_office_household: rgbd_dataset_freiburg3_long_office_household.tgz",
        size: "2585 images of 640 x 480, about 1.3 GB, and as many of depth",
        url: IMAGES,
        how: TUM,
    },
    Download {
        folders: &["rgbd_dataset_freiburg3_teddy"],
        sequences: &["02", "07"],
        what: "TUM RGB-D, fr3/teddy: rgbd_dataset_freiburg3_teddy.tgz",
        size: "about 2400 images of 640 x 480, about 1.2 GB, and as many of depth",
        url: IMAGES,
        how: TUM,
    },
    Download {
        folders: &["rgbd_dataset_freiburg3_large_cabinet"],
        sequences: &["03", "08"],
        what: "TUM RGB-D, fr3/large_cabinet: rgbd_dataset_freiburg3_large_cabinet.tgz",
        size: "about 1000 images of 640 x 480, about 0.5 GB, and as many of depth",
        url: IMAGES,
        how: TUM,
    },
    Download {
        folders: &["dataset/sequences/00", "dataset/poses"],
        sequences: &["04"],
        what: "KITTI odometry: data set (grayscale), calibration files and ground truth poses",
        size: "22 GB for all sequences, of which 00 is used; calibration and poses 5 MB",
        url: "https://www.cvlibs.net/datasets/kitti/eval_odometry.php",
        how: "unpack the three archives in DATA; image_0 and calib.txt of 00 and poses/00.txt are used",
    },
    Download {
        folders: &["castle-P30"],
        sequences: &["05"],
        what: "Strecha et al., castle-P30: images and gt_dense_cameras",
        size: "30 images of 3072 x 2048, 78 MB",
        url: "https://github.com/openMVG/SfM_quality_evaluation",
        how: "put castle-P30 of the folder Benchmarking_Camera_Calibration_2008 into DATA",
    },
];

/// The list as text for people.
pub fn where_to_find() -> String {
    let entry = |download: &Download| {
        format!(
            "{}  (sequence {})\n    {}\n    {}\n    {}\n    {}\n\n",
            download.folders.join(", "),
            download.sequences.join(" and "),
            download.what,
            download.size,
            download.url,
            download.how,
        )
    };
    DOWNLOADS.iter().map(entry).collect()
}
