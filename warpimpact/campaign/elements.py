"""By which finite elements a campaign is computed, where its table [continuum] does not say so."""

from __future__ import annotations

from pydantic import ValidationError

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.tables import ContinuumTable
from warpimpact.campaign.text import as_campaign_error
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.continuum.handover import layers_before_base
from warpimpact.errors import CampaignError
from warpimpact.scene.bullet import Bullet
from warpimpact.scene.model import complaint
from warpimpact.scene.target import layer_name

CORE_STEEL = "core steel"
"""Entry of the catalogue with the constants of cores that deform."""


def continuum_table(campaign: Campaign) -> ContinuumTable:
    """The finite elements of a campaign: where its table does not say so, those of all layers but a solid base behind a
    gap, and of the materials of these layers."""
    settings = with_layers(campaign)
    if not settings.materials:
        names = layer_materials(campaign, settings.layers)
        if None in names:
            place = layer_name(names.index(None))
            raise CampaignError(
                f"{place}.material: not given, but finite elements need one; or give continuum.materials, "
                "or --material to warpimpact continuum"
            )
        try:
            settings = ContinuumTable.model_validate(settings.model_dump() | {"materials": tuple(names)})
        except ValidationError as error:
            raise CampaignError(f"continuum.materials: {complaint(error.errors(include_url=False)[0])}") from None
    bullet, core = campaign.bodies
    bullet = whole_bullet(campaign) if bullet == "whole" else bullet
    core = flow_entry(CORE_STEEL).flow if core == "deformable" else core
    settings = settings.model_copy(update={"bullet": bullet, "core": core})
    with as_campaign_error():
        settings.method.check(campaign.scene)
    return settings


def whole_bullet(campaign: Campaign) -> Bullet:
    """The bullet of a campaign, with its wall and with the constants of its materials.

    Raises:
        CampaignError: the campaign has none, or it does not close.
    """
    if (bullet := campaign.bullet) is None:
        raise CampaignError(
            'continuum.bullet: got "whole", but the campaign has no bullet; give a table [bullet], or a core.threat '
            "whose bullet the catalogue knows"
        )
    for key in ("jacket", "filler"):
        if isinstance(name := getattr(bullet, key), str):
            with as_campaign_error(f"bullet.{key}: "):
                bullet = bullet.model_copy(update={key: flow_entry(name).flow})
    with as_campaign_error():
        return bullet.closed(campaign.core)


def with_layers(campaign: Campaign) -> ContinuumTable:
    """The finite elements of a campaign, with their number of layers where it is not that of all."""
    settings, target = campaign.continuum, campaign.target
    before = layers_before_base(campaign.scene.core, target)
    if settings.layers is None and before < len(target.layers):
        settings = settings.model_copy(update={"layers": before})
    return settings


def layer_materials(campaign: Campaign, layers: int | None) -> list[str | None]:
    """Names of the materials of the first layers; None is all layers."""
    return [layer.material for layer in campaign.target.layers[:layers]]
