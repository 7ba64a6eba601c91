"""A grabber with its card under a fake kernel, ready to be opened."""

from drivers.v4l2.computer import Computer
from drivers.v4l2.fake_kernel import Camera, Card, FakeKernel
from grabberd_v4l2 import V4l2Grabber
from grabberd_v4l2.abi import Arrangement

WOVEN = (Arrangement.INTERLACED,)


class Bench:
    """A computer with one card in it.

    Attributes:
        computer: its /sys and /dev; kernel: its system calls; card: the card, under `node`.
        grabber: the driver under test; usb_id: VENDOR:PRODUCT of a device on USB.
    """

    def __init__(self, folder, card=None, usb_id="", **options):
        self.usb_id = usb_id
        self.computer, self.kernel = Computer(folder / "computer"), FakeKernel()
        self.card = card_with() if card is None else card
        self.plug()
        named = {} if "usb" in options or "device" in options else {"device": "/dev/video0"}
        options = {"profiles": folder / "profiles.d"} | named | options
        self.grabber = V4l2Grabber(kernel=self.kernel, roots=self.computer.roots, **options)

    def plug(self, number=0):
        """The card appears under a node."""
        if self.card.bus_info.startswith("usb"):
            id_ = {"vendor_product": self.usb_id} if self.usb_id else {}
            self.node = self.computer.plug_dongle(number, self.card.driver, **id_)
        else:
            self.node = self.computer.plug_card(number, self.card.driver)
        self.number = number
        self.card.plugged = True
        self.kernel.add(self.node, self.card)

    def unplug(self):
        """The card goes, its node too."""
        self.card.plugged = False
        self.computer.pull(self.number)
        del self.kernel.cards[self.node]

    def nothing_is_left_behind(self):
        """Whether no descriptor is open and nothing mapped."""
        left = sum(pages._memory is not None for pages in self.kernel.pages)
        return not self.kernel.descriptors and not left


ALL_ORDERS = tuple(a for a in Arrangement if a not in (Arrangement.ANY, Arrangement.NONE))


def card_with(**traits):
    """A Bt878 that can have every field order."""
    return Card(**{"orders": ALL_ORDERS, **traits})


def pci_card(driver, **traits):
    """A PCI card with woven frames."""
    return Card(**{"driver": driver, "orders": WOVEN, **traits})


def dongle(**traits):
    """A USB dongle with woven frames."""
    return Card(
        **{
            "driver": "em28xx",
            "card": "USB grabber (fake)",
            "bus_info": "usb-0000:00:14.0-2",
            "formats": ("YUYV",),
            "orders": WOVEN,
            "tells": "querystd",
            **traits,
        }
    )


def camera(**traits):
    """A digital camera on USB."""
    return Camera(**traits)
