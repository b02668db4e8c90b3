"""A report for a customer: what its first page says, and which logos are let in."""

from __future__ import annotations

import io

import pytest
from lxml import html as lxml_html
from PIL import Image

from picchio.core.errors import InputError
from picchio.visuals.report.assessment import assessment_report
from picchio.visuals.report.cover import Cover, embedded

SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:x="http://www.w3.org/1999/xlink">{}</svg>'


def bitmap(kind, size=(8, 4)):
    stream = io.BytesIO()
    Image.new("RGB", size).save(stream, kind)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("content", "start"),
    [
        (bitmap("PNG"), "data:image/png;base64,"),
        (bitmap("JPEG"), "data:image/jpeg;base64,"),
        (SVG.format('<rect width="9"/><use href="#a"/>').encode(), "data:image/svg+xml;base64,"),
    ],
)
def test_pictures_become_a_part_of_the_page(tmp_path, content, start):
    path = tmp_path / "logo"
    path.write_bytes(content)
    assert embedded(path).startswith(start)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (SVG.format("<script>x</script>"), "script"),
        (SVG.format("<foreignObject/>"), "foreignobject"),
        (SVG.format('<rect onload="x"/>'), "onload"),
        (SVG.format('<image x:href="http://a/b.png"/>'), "href"),
        (SVG.format('<rect fill="url(http://a)"/>'), "fill"),
        (SVG.format("<style>@import 'http://a'</style>"), "style"),
        ('<!DOCTYPE svg [<!ENTITY a "b">]>' + SVG.format("&a;"), "document type"),
        ("GIF89a", "unknown kind"),
        ("<html/>", "unknown kind"),
        (bitmap("PNG")[:60], "damaged"),
        (b"\x89PNG\r\n\x1a\n" + b"0" * 2_000_000, "too large"),
        (bitmap("PNG", (5000, 5000)), "too large"),
    ],
)
def test_what_is_more_than_a_picture_is_refused(tmp_path, content, words):
    path = tmp_path / "logo"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=words):
        embedded(path)


def test_the_first_page(tmp_path, arm):
    logo = tmp_path / "logo.png"
    logo.write_bytes(bitmap("PNG"))
    cover = Cover("Riveting of <b>", "Aero & Sons", "A. N. Engineer", logo)
    page = assessment_report(arm.assessment, arm.robot, arm.task, cover=cover)
    tree = lxml_html.fromstring(page)
    top = tree.xpath("//header")[0]
    text = " ".join(top.itertext())
    for word in ("Riveting of <b>", "Aero & Sons", "A. N. Engineer", cover.day.isoformat()):
        assert word in text
    assert top.xpath("//img/@src")[0].startswith("data:image/png")
    assert top.xpath("//figure/*[local-name()='svg']//*[local-name()='image']")  # the robot
    # The verdict is above all else but the title, in its own colour; green is for safe alone.
    verdict = tree.xpath("//*[@id='verdict']")[0]
    assert verdict.get("class") == f"verdict {arm.assessment.verdict.status}"
    assert [e.tag for e in top if e.tag in ("h1", "p", "div")][-2:] == ["p", "div"]
    # What entered, and where the material is from.
    whole = " ".join(tree.itertext())
    assert "excitation: preload, N" in whole and "engineering assumption, no source" in whole
    assert "@bottom-right" in page and "counter(pages)" in page


def test_options_of_a_report_need_one(in_process):
    for option in ("--title", "--customer", "--author", "--logo"):
        done = in_process("assess", "fanuc_like_3dof", option, "x")
        assert done.returncode == 2 and "--report" in done.stderr
