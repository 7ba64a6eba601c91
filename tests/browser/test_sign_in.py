"""Signing in with a token, and what a role is offered."""

from playwright.sync_api import Page, expect

from browser.axe import serious
from browser.conftest import PHONE, Guarded, Open
from browser.daemons import Daemon


def sign_in(page: Page, token: str) -> None:
    page.get_by_label("Token").fill(token)
    page.get_by_role("button", name="Sign in").click()


def test_who_is_not_known_sees_the_sign_in_and_no_state(guarded: Guarded, open_page: Open) -> None:
    page = open_page(guarded.url, size=PHONE).page
    expect(page.get_by_role("heading", name="Sign in")).to_be_visible()
    assert "devices" not in page.content()
    assert serious(page) == []


def test_a_wrong_token_is_refused_in_words(guarded: Guarded, open_page: Open) -> None:
    watched = open_page(guarded.url)
    watched.expect_errors("401")
    sign_in(watched.page, "grb_wrong")
    expect(watched.page.locator(".refusal")).to_contain_text("does not know this token")


def test_an_operator_signs_in_once_and_out_again(guarded: Guarded, open_page: Open) -> None:
    watched = open_page(guarded.url)
    page = watched.page
    sign_in(page, guarded.tokens["operator"])
    expect(page.get_by_role("button", name="Start")).to_be_enabled()
    page.reload()
    expect(page.get_by_role("button", name="Start")).to_be_enabled()
    page.get_by_label("Menu").click()
    expect(page.locator(".menu-role")).to_have_text("Operator operator")
    page.get_by_role("button", name="Sign out").click()
    expect(page.get_by_role("heading", name="Sign in")).to_be_visible()
    assert guarded.tokens["operator"] not in str(page.evaluate("Object.values(localStorage)"))


def test_a_viewer_is_offered_nothing_to_start_or_set(guarded: Guarded, open_page: Open) -> None:
    page = open_page(guarded.url).page
    sign_in(page, guarded.tokens["viewer"])
    expect(page.locator("#start-why")).to_contain_text("View only")
    expect(page.get_by_role("button", name="Start")).to_be_hidden()
    expect(page.get_by_label("How many")).to_be_hidden()
    page.get_by_role("link", name="Picture", exact=True).click()
    expect(page.get_by_label("Threshold")).to_be_disabled()


def test_at_the_machine_without_tokens_nobody_signs_in(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    expect(page.get_by_role("button", name="Start")).to_be_enabled()
    page.get_by_label("Menu").click()
    expect(page.locator(".menu-role")).to_contain_text("without sign-in")
    expect(page.get_by_role("button", name="Sign out")).to_have_count(0)
