"""Profiles of liners, pulsators, cups and cows: list, read, store by versions, retire."""

from functools import partial
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Path, Query, Request, Response, status

from grabberd.documents.document import JsonObject
from grabberd.errors import InputError
from grabberd.server.api.routes.dependencies import (
    PROBLEMS,
    TAKES_KEY,
    Cursor,
    Limit,
    OnceRoute,
    ServiceOf,
    by_number,
    page_of,
)
from grabberd_liner.part import liner_of
from grabberd_liner.profiles.documents import (
    NAME_PATTERN,
    ProfileDocument,
    ProfileKind,
    ProfileList,
    ProfileRequest,
    ProfileVersions,
)
from grabberd_liner.profiles.profiles import check_name, read_profile

router = APIRouter(prefix="/profiles", tags=["profiles"], responses=PROBLEMS, route_class=OnceRoute)

Kind = Annotated[ProfileKind, Path(description="Kind of the profile.")]
Name = Annotated[str, Path(pattern=NAME_PATTERN, description="Name of the profile.")]
Number = Annotated[int, Path(ge=1, le=2**31 - 1, description="Number of the version.")]


@router.get("", summary="List the profiles")
def list_profiles(
    service: ServiceOf,
    kind: Annotated[ProfileKind | None, Query(description="Only profiles of this kind.")] = None,
    name: Annotated[
        str | None,
        Query(pattern=NAME_PATTERN, description="Only those of this name, as a label would find them."),
    ] = None,
    retired: Annotated[bool, Query(description="True: list retired ones, too.")] = False,
    limit: Limit = 100,
    cursor: Cursor = None,
) -> ProfileList:
    """The newest version of each profile, the latest change first, page by page."""
    profiles = liner_of(service).profiles
    heads = profiles.heads(kind, name=name, retired=retired)
    page, following = page_of(
        heads,
        lambda head: head.place,
        lambda head: profiles.row(head.kind, head.name, head.version),
        limit,
        cursor,
    )
    return ProfileList(profiles=page, next=following)


@router.post("", status_code=status.HTTP_201_CREATED, dependencies=[TAKES_KEY], summary="Store a new profile")
def add_profile(
    new: ProfileRequest, service: ServiceOf, request: Request, response: Response
) -> ProfileDocument:
    """Store the first version of a profile. 409 if there is one of its kind and name, even a retired one."""
    stored = liner_of(service).profiles.put(_document(new), after=0)
    response.headers["Location"] = _address(request, stored.document)
    return stored.document


@router.get("/{kind}/{name}", summary="Get a profile")
def get_profile(kind: Kind, name: Name, service: ServiceOf) -> ProfileDocument:
    """The newest version of a profile, retired or not."""
    return liner_of(service).profiles.get(kind, name)


@router.put(
    "/{kind}/{name}", responses={201: {"model": ProfileDocument}}, summary="Store a profile's next version"
)
def put_profile(
    kind: Kind, name: Name, new: ProfileRequest, service: ServiceOf, request: Request, response: Response
) -> ProfileDocument:
    """Store the next version of a profile, or the first (201), and reinstate a retired one. Unchanged content
    creates no version. 409 if the newest version is not `after`.
    """
    document = _document(new)
    check_name(document, kind, name)
    stored = liner_of(service).profiles.put(document, after=new.after)
    if stored.is_new and stored.document.version == 1:
        response.status_code = status.HTTP_201_CREATED
        response.headers["Location"] = _address(request, stored.document)
    return stored.document


@router.delete("/{kind}/{name}", summary="Retire a profile")
def retire_profile(kind: Kind, name: Name, service: ServiceOf) -> ProfileDocument:
    """Retire a profile: labels no longer select it. All of its versions stay readable."""
    return liner_of(service).profiles.retire(kind, name)


@router.get("/{kind}/{name}/versions", summary="List a profile's versions")
def list_profile_versions(
    kind: Kind, name: Name, service: ServiceOf, limit: Limit = 100, cursor: Cursor = None
) -> ProfileVersions:
    """The versions of a profile, newest first, page by page."""
    profiles = liner_of(service).profiles
    row = partial(profiles.row, kind, name)
    page, following = page_of(profiles.versions(kind, name), by_number, row, limit, cursor)
    return ProfileVersions(versions=page, next=following)


@router.get("/{kind}/{name}/versions/{version}", summary="Get a version of a profile")
def get_profile_version(kind: Kind, name: Name, version: Number, service: ServiceOf) -> ProfileDocument:
    """One version of a profile; it never changes."""
    return liner_of(service).profiles.get(kind, name, version)


def _document(new: ProfileRequest) -> JsonObject:
    """The document of a request.

    Raises:
        InputError: There is none, there are two, or it is no YAML.
    """
    if (new.profile is None) == (new.yaml is None):
        raise InputError("give either profile or yaml", "profile is the document, yaml the same as YAML text")
    return read_profile(new.yaml) if new.yaml is not None else dict(new.profile or {})


def _address(request: Request, document: ProfileDocument) -> str:
    # A header has ASCII alone, a name any letters.
    return quote(str(request.url_for("get_profile", kind=document.kind, name=document.name)), safe=":/[]")
