"""Installs shimmy_ros: by colcon as an ament_python package, by pip as any other."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "shimmy_ros"


def data_files():
    """What lies beside the modules, for share/shimmy_ros, and the package's entry in the index."""
    files = [
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ]
    for folder in ("config", "launch", "msgs_spec"):
        for directory in sorted({path.parent for path in Path(folder).rglob("*.*")}):
            inside = [
                str(path)
                for path in sorted(directory.glob("*.*"))
                if path.is_file() and path.suffix != ".pyc"
            ]
            if inside:
                files.append((f"share/{NAME}/{directory.as_posix()}", inside))
    return files


setup(
    name=NAME,
    version="0.1.0",
    description="Predicts and simulates the shimmy limit cycles of a landing gear in ROS 2.",
    author="shimmy_ros maintainers",
    author_email="maintainers@shimmy-ros.example",
    maintainer="shimmy_ros maintainers",
    maintainer_email="maintainers@shimmy-ros.example",
    license="Apache-2.0",
    keywords=["ROS", "landing gear", "shimmy", "limit cycle", "harmonic balance"],
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3",
        "Programming Language :: Python :: 3.10",
        "Programming Language :: Python :: 3.11",
        "Programming Language :: Python :: 3.12",
        "Programming Language :: Python :: 3.13",
        "Topic :: Scientific/Engineering :: Physics",
    ],
    python_requires=">=3.10,<3.14",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed"]},
    data_files=data_files(),
    zip_safe=False,
    # The lower bounds are Ubuntu 24.04's, where it has the package.
    install_requires=[
        "lz4>=4.0.2",
        "matplotlib>=3.6.3",
        "mcap>=1.5",
        "numba>=0.59",
        "numpy>=1.26.4",
        "PyYAML>=6.0.1",
        "rosbags>=0.11.6",
        "scipy>=1.11.4",
        "tqdm>=4.66.2",
        "zstandard>=0.22",
    ],
    extras_require={
        # The unversioned `ros-rclpy` is a later distribution's.
        "ros": ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces"],
        # `colcon test` looks for pytest here. ROS 2 Jazzy's own pytest plugins need pytest < 9.
        # The other upper bounds keep new lint rules, new type stubs and new deprecation warnings,
        # which are errors, from failing a tree that has not changed.
        "test": [
            "hypothesis>=6.98",
            "jsonschema>=4.10",
            "matplotlib<3.12",
            "mcap-ros2-support>=0.5",
            "mypy>=2.4,<2.5",
            "numpy<2.6",
            "pytest>=7.4,<9",
            "ruff>=0.17,<0.18",
            "scipy<1.19",
            "scipy-stubs",
            "setuptools",
            "types-PyYAML",
            "types-tqdm",
        ],
    },
    entry_points={
        "console_scripts": [
            "shimmy = shimmy_ros.cli.main:main",
            "predictor = shimmy_ros.nodes.predictor:main",
            "simulator = shimmy_ros.nodes.simulator:main",
        ],
    },
)
