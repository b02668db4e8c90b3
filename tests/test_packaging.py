"""The package as it is shipped: built, installed elsewhere, run in an empty folder."""

import ast
import os
import re
import subprocess
import sys
import tomllib
import zipfile

import pytest
import yaml

# Distributions whose modules have another name. pydantic_core is the other half of pydantic, to
# which it is pinned.
MODULE_OF = {
    "pin": "pinocchio",
    "u-msgpack-python": "umsgpack",
    "mcap-ros2-support": "mcap_ros2",
    "pydantic": "pydantic pydantic_core",
    "pillow": "PIL",
    "mat-io": "matio",
    "rerun-sdk": "rerun",
}
# Distributions that conda-forge calls otherwise.
CONDA_NAME = {"pin": "pinocchio", "meshcat": "meshcat-python", "matplotlib": "matplotlib-base"}
# Used without being imported: robots that are found among its files; what trimesh reads .dae with.
NOT_IMPORTED = {"example-robot-data", "pycollada"}
# Imported only where it runs already: Jupyter brings it.
FOUND_RUNNING = {"IPython"}


def distributions(entries):
    return {re.match(r"[\w.-]+", entry)[0] for entry in entries}


def modules_of(names):
    return {m for name in names for m in MODULE_OF.get(name, name.replace("-", "_")).split()}


def test_dependencies_are_what_is_imported(repository):
    project = tomllib.loads((repository / "pyproject.toml").read_text())["project"]
    hard = distributions(project["dependencies"])
    extras = project["optional-dependencies"]
    optional = {name for key in extras if key not in ("test", "docs")
                for name in distributions(extras[key])}  # fmt: skip
    imported = set()
    for path in (repository / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                imported.add(node.module.partition(".")[0])
    foreign = imported - set(sys.stdlib_module_names) - {"picchio"}
    assert modules_of(hard - NOT_IMPORTED) <= foreign
    assert foreign <= modules_of(hard | optional) | FOUND_RUNNING
    pinned = {line.partition("==")[0].strip().lower().replace("_", "-")
              for line in (repository / "constraints.txt").read_text().splitlines()}  # fmt: skip
    asked = hard | {name for key in extras for name in distributions(extras[key])}
    assert {name.lower().replace("_", "-") for name in asked} <= pinned


def test_extras_that_are_advised_exist(repository):
    extras = tomllib.loads((repository / "pyproject.toml").read_text())["project"]
    advised = set()
    for path in [*(repository / "src").rglob("*.py"), repository / "README.md"]:
        advised |= set(re.findall(r"picchio\[([\w-]+)\]", path.read_text("utf-8")))
    assert advised and advised <= set(extras["optional-dependencies"])


def test_the_conda_recipe_asks_for_what_the_package_asks_for(repository):
    project = tomllib.loads((repository / "pyproject.toml").read_text())["project"]
    recipe = yaml.safe_load((repository / "packaging" / "recipe.yaml").read_text())
    asked = {f"python {project['requires-python']}"}
    for entry in project["dependencies"]:
        name, bound = re.fullmatch(r"([\w.-]+)(.*)", entry).groups()
        asked.add(f"{CONDA_NAME.get(name, name)} {bound}")
    run = recipe["requirements"]["run"]
    assert set(run) == asked and len(run) == len(asked)
    assert recipe["context"]["version"] == project["version"]
    assert recipe["about"]["license"] == project["license"]
    (script,) = recipe["build"]["python"]["entry_points"]
    assert script.split(" = ") == ["picchio", project["scripts"]["picchio"]]


def test_the_container_gets_what_the_wheel_is_made_of(repository):
    project = tomllib.loads((repository / "pyproject.toml").read_text())
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    ignored = (repository / "packaging" / "Dockerfile.dockerignore").read_text().split()
    let_in = {line[1:] for line in ignored if line[0] == "!"}
    made_of = {project["project"]["readme"], *project["project"]["license-files"]}
    made_of |= {path.partition("/")[0] for path in (*wheel["packages"], *wheel["force-include"])}
    assert let_in == made_of | {"pyproject.toml", "constraints.txt"}
    dockerfile = (repository / "packaging" / "Dockerfile").read_text()
    (version,) = set(re.findall(r"^FROM python:([\d.]+)-slim", dockerfile, re.M))
    assert f"Programming Language :: Python :: {version}" in project["project"]["classifiers"]


def test_one_version_everywhere(repository):
    version = tomllib.loads((repository / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (repository / "CITATION.cff").read_text()
    assert "\n## Unreleased\n" in (repository / "CHANGELOG.md").read_text()


@pytest.mark.slow
def test_an_installed_wheel_assesses_the_shipped_robot_in_an_empty_folder(tmp_path, repository):
    wheels, site, empty = tmp_path / "wheels", tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run(
        [*pip, "wheel", "--no-deps", "--wheel-dir", wheels, repository], check=True, timeout=300
    )
    (wheel,) = wheels.glob("picchio-*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    # All files of the package and of the robots, and nothing else.
    given = {
        f"{to}/{path.relative_to(repository / start).as_posix()}"
        for start, to in (("src/picchio", "picchio"), ("robots", "picchio/_robots"))
        for path in (repository / start).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert {name for name in names if ".dist-info/" not in name} == given
    assert "picchio/py.typed" in names
    assert "picchio/_robots/fanuc_like_3dof/robot.urdf" in names
    subprocess.run([*pip, "install", "--no-deps", "--target", site, wheel], check=True, timeout=300)
    code = (
        "import picchio; print(picchio.__file__)\n"
        "from picchio.cli.main import main; main(['assess', 'fanuc_like_3dof'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=empty,
        env={**os.environ, "PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    where, _, rest = done.stdout.partition("\n")
    assert where.startswith(str(site))
    assert "of joint_2 comes closest" in rest
    assert list(empty.iterdir()) == []
