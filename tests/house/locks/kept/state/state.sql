BEGIN TRANSACTION;
CREATE TABLE annotations (
            capture TEXT PRIMARY KEY, pinned INTEGER NOT NULL, note TEXT, labels TEXT, marks TEXT) WITHOUT ROWID;
INSERT INTO "annotations" VALUES('liner',1,'kept for ever','{"liner": "example-reference", "cow": "example-112", "teat": "front left"}','{"25": "open", "3": "first"}');
INSERT INTO "annotations" VALUES('object',0,'',NULL,NULL);
CREATE TABLE idempotency (
            key TEXT PRIMARY KEY, digest BLOB NOT NULL, created_utc TEXT NOT NULL, status INTEGER,
            location TEXT, body BLOB NOT NULL DEFAULT x'') WITHOUT ROWID;
INSERT INTO "idempotency" VALUES('admin-one POST /api/v1/profiles lock-1',X'9289ED8E4234200FA9ABD7BC70499820680886B9D35BEA93B7768689F5202F3C','2026-11-28T16:39:29.951Z',201,'http://localhost/api/v1/profiles/cow/once',X'7B226B696E64223A22636F77222C226E616D65223A226F6E6365222C2276657273696F6E223A312C226E6577657374223A312C22637265617465645F757463223A22323032362D31312D32385431363A33393A32392E3938375A222C22726574697265645F757463223A6E756C6C2C22736861323536223A2237396230636131663936386633373339316231623436626333323639316135306439613330303338346135636564373137393038626235396462393437663339222C226E6F7465223A22222C2270726F626C656D223A6E756C6C2C2270726F66696C65223A7B226B696E64223A22636F77222C226E616D65223A226F6E6365222C226C6163746174696F6E223A317D2C2279616D6C223A226B696E643A20636F775C6E6E616D653A206F6E63655C6E6C6163746174696F6E3A20315C6E227D');
CREATE TABLE outbox (capture TEXT PRIMARY KEY, summary TEXT) WITHOUT ROWID;
INSERT INTO "outbox" VALUES('liner','{"capture_id": "liner", "note": "a receiver waits for it"}');
INSERT INTO "outbox" VALUES('object',NULL);
CREATE TABLE profiles (
            kind TEXT NOT NULL, name TEXT NOT NULL, version INTEGER NOT NULL CHECK (version >= 1),
            created_utc TEXT NOT NULL, sha256 TEXT NOT NULL, content TEXT NOT NULL,
            PRIMARY KEY (kind, name, version)) WITHOUT ROWID;
INSERT INTO "profiles" VALUES('cow','example-112',1,'2026-11-28T16:39:29.652Z','5d970e502de5e4b129bb0f7819a817e6997bee76533829edb2833ab4e2ae6c04','{"kind": "cow", "name": "example-112", "note": "Example, no real cow. Her teat is that of the simulated wall \"reference-round\".", "lactation": 2, "teats": {"front left": {"length_mm": 50.0, "diameter_mm": 19.6, "shape": "round"}}, "flow_stop": {"kpa": 9.0, "sigma_kpa": 1.0}}');
INSERT INTO "profiles" VALUES('cow','example-112',2,'2026-11-28T16:39:29.691Z','e1f6742e812a78665b3ac27d8af46d15dbedde266e01156abc7429cd0269d003','{"kind": "cow", "name": "example-112", "note": "Example, no real cow. Her teat is that of the simulated wall \"reference-round\".", "lactation": 3, "teats": {"front left": {"length_mm": 50.0, "diameter_mm": 19.6, "shape": "round"}}, "flow_stop": {"kpa": 9.0, "sigma_kpa": 1.0}}');
INSERT INTO "profiles" VALUES('cow','once',1,'2026-11-28T16:39:29.987Z','79b0ca1f968f37391b1b46bc32691a50d9a300384a5ced717908bb59db947f39','{"kind": "cow", "name": "once", "lactation": 1}');
INSERT INTO "profiles" VALUES('cup','example-simulated',1,'2026-11-28T16:39:29.631Z','bbf7861df96e6b06df7da7f9c23977e1effcfbe512ea791b28196f3dd1c533d9','{"kind": "cup", "name": "example-simulated", "note": "Example, no real cup. Its targets are those of configs/objects/liner.yaml.", "device": "simulated", "object_model": "liner", "gauge": "none, simulated", "gauge_sigma_kpa": 0.2}');
INSERT INTO "profiles" VALUES('liner','example-reference',1,'2026-11-28T16:39:29.472Z','d0cf5f580f08b4e8a1c107c45710834bd648ce83cd121cfd8693bd1a5610230e','{"kind": "liner", "name": "example-reference", "note": "Example, no real liner. It is the simulated wall reference, which the simulator shows unless it is told otherwise.", "maker": "none, simulated", "type": "reference", "age_milkings": 0, "material": {"law": "neo_hookean", "E_mpa": 3.0, "E_sigma_mpa": 0.1, "wall_mm": 2.5, "wall_sigma_mm": 0.05, "poisson": 0.5, "F0_n": 60.0, "F0_sigma_n": 3.0, "radius_mm": 12.5, "target_mm": 0.0, "first_end_mm": -65.0, "last_end_mm": 65.0}, "obtained": {"E_mpa": "design of the simulation; of a real liner, a ramp with the empty liner", "wall_mm": "design of the simulation; of a real liner, a calliper at six points and three heights", "radius_mm": "design of the simulation; of a real liner, its drawing", "F0_n": "design of the simulation; of a real liner, a spring balance at mounting"}, "lag": {"opening_s": 0.004, "closing_s": -0.003, "sigma_s": 0.005}, "analysis": {"reference": {"phase": 0.3}, "plane": "symmetry", "heights_mm": [-30, 0, 30], "phases": 24, "sought_kpa": 1.0}}');
INSERT INTO "profiles" VALUES('pulsator','example-simulated',1,'2026-11-28T16:39:29.550Z','2e4b2cc224dba7f0396dfca3530400669531b6d3b7addbeafadaeb6ffe751927','{"kind": "pulsator", "name": "example-simulated", "note": "Example, no real pulsator. It is that of the simulator, unless that is told otherwise.", "maker": "none, simulated", "tested": "design of the simulation", "pulsation": {"rate_per_min": 60.0, "ratio": 0.6081, "a_s": 0.09714, "c_s": 0.08095, "system_kpa": 42.0, "sigma_kpa": 0.5}, "liner": {"kpa": 42.0, "sigma_kpa": 0.5}}');
CREATE TABLE retired_profiles (
            kind TEXT NOT NULL, name TEXT NOT NULL, retired_utc TEXT NOT NULL,
            PRIMARY KEY (kind, name)) WITHOUT ROWID;
INSERT INTO "retired_profiles" VALUES('cup','example-simulated','2026-11-28T16:39:29.739Z');
CREATE TABLE sessions (
            hash BLOB PRIMARY KEY, token TEXT NOT NULL REFERENCES tokens (name) ON DELETE CASCADE,
            created_utc TEXT NOT NULL, expires_utc TEXT NOT NULL) WITHOUT ROWID;
INSERT INTO "sessions" VALUES(X'41FBB2ADE0E333F6BD60AD38F573DF7CB52F1E46E13DAE015366D590F364B3F2','operator-one','2026-11-28T16:39:21.372Z','2026-12-28T16:39:21.372Z');
CREATE TABLE settings (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
INSERT INTO "settings" VALUES('active_calibration.simulated','{"id": "stored-active", "activated_utc": "2026-11-28T16:39:29.828Z"}');
INSERT INTO "settings" VALUES('analysed_when_sealed_since','{}');
INSERT INTO "settings" VALUES('rejected_calibrations','{"stored-rejected": {"rejected_utc": "2026-11-28T16:39:29.890Z", "note": "the frame was touched"}}');
INSERT INTO "settings" VALUES('scrub','{"ended_utc": "2026-11-28T16:39:20.480Z", "damaged": {}}');
INSERT INTO "settings" VALUES('tested_when_sealed_since','{"simulated": "2026-11-28T16:39:20.438Z"}');
INSERT INTO "settings" VALUES('threshold.simulated','{"kind": "fixed", "value": 96, "map": false}');
CREATE TABLE tokens (
            name TEXT PRIMARY KEY, role TEXT NOT NULL CHECK (role IN ('viewer', 'operator', 'admin')),
            hash BLOB NOT NULL UNIQUE, created_utc TEXT NOT NULL, expires_utc TEXT) WITHOUT ROWID;
INSERT INTO "tokens" VALUES('admin-one','admin',X'D8F26944FBDFE124F160B309DA999696E01DEF3EC472E0D215FDB4D6300F767C','2026-11-28T16:39:20.561Z',NULL);
INSERT INTO "tokens" VALUES('brief','viewer',X'04DC96AED45517C23A1AC909902C5A8BD679905E479E869C7FDB16814741BD86','2026-11-28T16:39:20.576Z','2026-11-28T17:39:20.576Z');
INSERT INTO "tokens" VALUES('operator-one','operator',X'3194BB59FC92D4B655F6E1E7AB4A3D51EB813243396D33CC83218583EBBD25D5','2026-11-28T16:39:20.538Z',NULL);
INSERT INTO "tokens" VALUES('viewer-one','viewer',X'8133B95050E27A89DA1FDEDA8628183004F006860E5627ADE7F1868030562275','2026-11-28T16:39:20.509Z',NULL);
CREATE INDEX outbox_waiting ON outbox (capture) WHERE summary IS NOT NULL;
COMMIT;
PRAGMA user_version = 7;
