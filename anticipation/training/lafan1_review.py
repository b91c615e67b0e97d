"""What the 111 ground contacts that a heuristic found in LaFAN1 are, looked at one by one.

Each was drawn as a strip of fourteen skeletons from 0.7 s before the onset to 3.3 s after the contact and looked at
beside four measurements (`lafan1.measure`). A fall goes down by itself: the pelvis sinks at 1.0 m/s or faster and the
trunk lies within a third of a second of the contact; or at 1.2 m/s with the shoulders on the floor within a second; or
at 1.6 m/s onto the seat. What meets that and was seen to be something else (a squat jump, a floor move of a dance,
dropping on all fours to crawl) is no fall, and says what it is. Slower than 1.0 m/s is no fall. The rest are UNCLEAR,
mostly actors who drop to sit or sit and lie back in one go: these are used neither as falls nor as negatives.

Ninety of the contacts are in the six `fallAndGetUp` files.
"""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple


class Seen(Enum):
    """What was seen."""

    FALL = "fall"
    NO_FALL = "no fall"
    UNCLEAR = "unclear"


class Verdict(NamedTuple):
    """One contact: file, frame in which the ground is reached, what was seen."""

    file: str
    ground: int
    seen: Seen
    what: str


FALL, NO_FALL, UNCLEAR = Seen.FALL, Seen.NO_FALL, Seen.UNCLEAR

VERDICTS: Final = (
    # dance1_subject1
    Verdict("dance1_subject1", 3228, NO_FALL, "dance: lands from a leap in a crouch"),
    Verdict("dance1_subject1", 3491, NO_FALL, "dance: lands from a leap in a crouch"),
    # dance2_subject4
    Verdict("dance2_subject4", 1759, NO_FALL, "dance: floor move over the hands"),
    Verdict("dance2_subject4", 1820, NO_FALL, "dance: floor move over the hands"),
    # fallAndGetUp1_subject1
    Verdict("fallAndGetUp1_subject1", 176, FALL, "sideways"),
    Verdict("fallAndGetUp1_subject1", 443, FALL, "sideways"),
    Verdict("fallAndGetUp1_subject1", 660, FALL, "sideways"),
    Verdict("fallAndGetUp1_subject1", 831, FALL, "trips, backwards"),
    Verdict("fallAndGetUp1_subject1", 1012, FALL, "backwards, rolls"),
    Verdict("fallAndGetUp1_subject1", 1396, FALL, "forwards onto the hands"),
    Verdict("fallAndGetUp1_subject1", 1546, FALL, "forwards, onto the side"),
    Verdict("fallAndGetUp1_subject1", 1786, FALL, "forwards, onto the side"),
    Verdict("fallAndGetUp1_subject1", 2012, NO_FALL, "squats, sits, lies down"),
    Verdict("fallAndGetUp1_subject1", 2262, FALL, "backwards"),
    Verdict("fallAndGetUp1_subject1", 2564, UNCLEAR, "sits and lies back in one go"),
    Verdict("fallAndGetUp1_subject1", 2857, FALL, "backwards"),
    Verdict("fallAndGetUp1_subject1", 3182, FALL, "backwards"),
    Verdict("fallAndGetUp1_subject1", 3426, UNCLEAR, "sits and lies back in one go"),
    Verdict("fallAndGetUp1_subject1", 3755, UNCLEAR, "sits and lies back in one go"),
    Verdict("fallAndGetUp1_subject1", 4097, UNCLEAR, "sits and lies back in one go"),
    Verdict("fallAndGetUp1_subject1", 4507, UNCLEAR, "crouches, then dives forwards"),
    Verdict("fallAndGetUp1_subject1", 4871, UNCLEAR, "dives forwards over one knee"),
    # fallAndGetUp1_subject4
    Verdict("fallAndGetUp1_subject4", 191, NO_FALL, "kneels, then on the hands"),
    Verdict("fallAndGetUp1_subject4", 374, NO_FALL, "squats, lies down on the side"),
    Verdict("fallAndGetUp1_subject4", 571, NO_FALL, "squats, lies down on the side"),
    Verdict("fallAndGetUp1_subject4", 930, NO_FALL, "kneels"),
    Verdict("fallAndGetUp1_subject4", 1319, NO_FALL, "goes down on the hands, then prone"),
    Verdict("fallAndGetUp1_subject4", 1705, NO_FALL, "sits, lies down"),
    Verdict("fallAndGetUp1_subject4", 1931, NO_FALL, "sits, lies down"),
    Verdict("fallAndGetUp1_subject4", 2232, NO_FALL, "sits down over one hand"),
    Verdict("fallAndGetUp1_subject4", 2558, NO_FALL, "kneels, sits down"),
    Verdict("fallAndGetUp1_subject4", 2915, NO_FALL, "sits down"),
    Verdict("fallAndGetUp1_subject4", 3223, NO_FALL, "sits down over one hand"),
    Verdict("fallAndGetUp1_subject4", 3535, NO_FALL, "down over one knee, lies down"),
    Verdict("fallAndGetUp1_subject4", 3909, NO_FALL, "squats, lies down on the side"),
    Verdict("fallAndGetUp1_subject4", 4452, NO_FALL, "crouches, then on the hands, lies down"),
    Verdict("fallAndGetUp1_subject4", 4776, NO_FALL, "sits, lies down on the side"),
    # fallAndGetUp1_subject5
    Verdict("fallAndGetUp1_subject5", 234, FALL, "forwards onto the hands, rolls to sit"),
    Verdict("fallAndGetUp1_subject5", 367, UNCLEAR, "drops to sit, hands behind"),
    Verdict("fallAndGetUp1_subject5", 660, NO_FALL, "bends, hands on the floor"),
    Verdict("fallAndGetUp1_subject5", 733, NO_FALL, "bends, hands on the floor, sits down later"),
    Verdict("fallAndGetUp1_subject5", 872, NO_FALL, "lunges, one hand on the floor"),
    Verdict("fallAndGetUp1_subject5", 973, UNCLEAR, "drops to sit over one hand"),
    Verdict("fallAndGetUp1_subject5", 1116, UNCLEAR, "drops to sit"),
    Verdict("fallAndGetUp1_subject5", 1364, UNCLEAR, "drops on the knees"),
    Verdict("fallAndGetUp1_subject5", 1636, UNCLEAR, "sideways over the knees"),
    Verdict("fallAndGetUp1_subject5", 1819, FALL, "backwards"),
    Verdict("fallAndGetUp1_subject5", 2023, UNCLEAR, "sideways over one hand"),
    Verdict("fallAndGetUp1_subject5", 2493, UNCLEAR, "drops on one knee and the hands"),
    Verdict("fallAndGetUp1_subject5", 2917, UNCLEAR, "onto the hands, rolls to sit"),
    Verdict("fallAndGetUp1_subject5", 3285, UNCLEAR, "onto the hands, rolls to sit"),
    Verdict("fallAndGetUp1_subject5", 3477, UNCLEAR, "drops to sit, hands behind"),
    Verdict("fallAndGetUp1_subject5", 3842, UNCLEAR, "drops to sit, hands behind"),
    Verdict("fallAndGetUp1_subject5", 4095, NO_FALL, "squats, hands on the floor"),
    Verdict("fallAndGetUp1_subject5", 4248, NO_FALL, "sits down, hands behind"),
    Verdict("fallAndGetUp1_subject5", 4439, UNCLEAR, "sideways over one hand"),
    Verdict("fallAndGetUp1_subject5", 4664, UNCLEAR, "drops to sit"),
    Verdict("fallAndGetUp1_subject5", 4868, NO_FALL, "on all fours, sits down"),
    # fallAndGetUp2_subject2
    Verdict("fallAndGetUp2_subject2", 201, NO_FALL, "squats, sits, lies down"),
    Verdict("fallAndGetUp2_subject2", 628, NO_FALL, "squats"),
    Verdict("fallAndGetUp2_subject2", 1089, NO_FALL, "kneels over one hand, lies down"),
    Verdict("fallAndGetUp2_subject2", 1441, NO_FALL, "squats, lies down on the side"),
    Verdict("fallAndGetUp2_subject2", 1709, UNCLEAR, "drops to sit"),
    Verdict("fallAndGetUp2_subject2", 2018, NO_FALL, "sits down"),
    Verdict("fallAndGetUp2_subject2", 2336, NO_FALL, "squats, lies down on the side"),
    Verdict("fallAndGetUp2_subject2", 2918, NO_FALL, "on all fours"),
    Verdict("fallAndGetUp2_subject2", 3318, NO_FALL, "sits, lies down"),
    Verdict("fallAndGetUp2_subject2", 3676, NO_FALL, "squats, then on the hands, prone"),
    Verdict("fallAndGetUp2_subject2", 3922, UNCLEAR, "sits, lies back"),
    Verdict("fallAndGetUp2_subject2", 4150, FALL, "backwards out of a walk"),
    Verdict("fallAndGetUp2_subject2", 4374, FALL, "sideways out of a run"),
    Verdict("fallAndGetUp2_subject2", 4527, FALL, "backwards out of a run"),
    Verdict("fallAndGetUp2_subject2", 4715, UNCLEAR, "drops to sit"),
    # fallAndGetUp2_subject3
    Verdict("fallAndGetUp2_subject3", 176, UNCLEAR, "drops to sit"),
    Verdict("fallAndGetUp2_subject3", 671, NO_FALL, "bends, on all fours, sits, lies down"),
    Verdict("fallAndGetUp2_subject3", 1085, UNCLEAR, "drops to sit"),
    Verdict("fallAndGetUp2_subject3", 1427, NO_FALL, "sits down"),
    Verdict("fallAndGetUp2_subject3", 1719, UNCLEAR, "drops to sit"),
    Verdict("fallAndGetUp2_subject3", 1981, UNCLEAR, "sits and lies back in one go"),
    Verdict("fallAndGetUp2_subject3", 2248, UNCLEAR, "onto the hands, rolls to sit"),
    Verdict("fallAndGetUp2_subject3", 2454, UNCLEAR, "drops to sit"),
    Verdict("fallAndGetUp2_subject3", 2728, NO_FALL, "on all fours, lies down"),
    Verdict("fallAndGetUp2_subject3", 3168, NO_FALL, "crawls, prone"),
    Verdict("fallAndGetUp2_subject3", 3606, NO_FALL, "crawls, prone"),
    Verdict("fallAndGetUp2_subject3", 3976, NO_FALL, "down over knees and hands, lies down on the side"),
    Verdict("fallAndGetUp2_subject3", 4487, NO_FALL, "drops on all fours, prone"),
    # fallAndGetUp3_subject1
    Verdict("fallAndGetUp3_subject1", 275, UNCLEAR, "forwards onto knee and hands"),
    Verdict("fallAndGetUp3_subject1", 1067, FALL, "backwards, lands sitting"),
    Verdict("fallAndGetUp3_subject1", 1211, FALL, "backwards, lands sitting"),
    Verdict("fallAndGetUp3_subject1", 1626, UNCLEAR, "forwards onto knees and hands"),
    Verdict("fallAndGetUp3_subject1", 1956, NO_FALL, "squats, lies down on the side"),
    Verdict("fallAndGetUp3_subject1", 2195, NO_FALL, "kneels, lies down on the side"),
    Verdict("fallAndGetUp3_subject1", 2404, NO_FALL, "squats, lies down on the side"),
    Verdict("fallAndGetUp3_subject1", 2666, NO_FALL, "kneels, lies down on the side"),
    # fight1_subject3
    Verdict("fight1_subject3", 6013, NO_FALL, "lunges"),
    Verdict("fight1_subject3", 6507, NO_FALL, "fight: drops onto the hands and kicks"),
    # fightAndSports1_subject1
    Verdict("fightAndSports1_subject1", 5073, NO_FALL, "squat jump"),
    Verdict("fightAndSports1_subject1", 5118, NO_FALL, "squat jump"),
    Verdict("fightAndSports1_subject1", 5189, NO_FALL, "squat jump"),
    Verdict("fightAndSports1_subject1", 5269, NO_FALL, "squat jump"),
    # jumps1_subject2
    Verdict("jumps1_subject2", 5678, NO_FALL, "squats, then on the hands, prone"),
    # walk2_subject3
    Verdict("walk2_subject3", 5336, NO_FALL, "walks crouched"),
    Verdict("walk2_subject3", 5584, NO_FALL, "walks crouched"),
    Verdict("walk2_subject3", 5898, NO_FALL, "walks crouched"),
    # walk3_subject1
    Verdict("walk3_subject1", 5480, NO_FALL, "sits down on the floor"),
    Verdict("walk3_subject1", 5737, NO_FALL, "sits down on the floor"),
    Verdict("walk3_subject1", 5988, NO_FALL, "sits down on the floor"),
    Verdict("walk3_subject1", 6247, NO_FALL, "sits down on the floor"),
    Verdict("walk3_subject1", 6524, NO_FALL, "sits down on the floor"),
    # walk3_subject3
    Verdict("walk3_subject3", 5185, NO_FALL, "crouches, crawls"),
    # walk3_subject4
    Verdict("walk3_subject4", 5865, NO_FALL, "kneels, sits, lies down"),
)
