-- P2OS for Wireshark and tshark: Pioneer robots and their clients.
--
-- Takes the captures of `p2os sniff --pcap` (link type USER0: one byte of
-- direction, then one frame) and TCP on any port: a conversation is taken for P2OS
-- when a segment begins like a frame. Who speaks first is the client, unless
-- it sends what only robots send. `p2os sniff --install-dissector` puts it into Wireshark's folder of personal
-- Lua plug-ins. MIT licence.

-- Names, numbers and layouts, from the tables of the package: `p2os sniff --install-dissector` writes them here.
local commands = {}
local packets = {}
-- Without an argument these are the same bytes; only the whole conversation tells.
local bare = {}
local argument_types = {}
local wire = {}
-- The fields of a SIP before its sonar readings, and those behind them: name, place (type byte first), bytes, signed.
local head = {}
local behind = {}
-- The ARCOS tail, in the order of the wire: name, bytes, signed, what it is.
local tail = {}

local p2os = Proto("p2os", "Pioneer P2OS")
local directions = { [0] = "client to robot", [1] = "robot to client" }

local function of_sip(row, name, title, shown)
    return ProtoField[(row.signed and "int" or "uint") .. 8 * row.bytes]("p2os.sip." .. name, title, shown or base.DEC)
end

local field = {
    direction = ProtoField.uint8("p2os.direction", "Direction", base.DEC, directions),
    count = ProtoField.uint8("p2os.count", "Byte count"),
    command = ProtoField.uint8("p2os.command", "Command", base.DEC, commands),
    packet = ProtoField.uint8("p2os.packet", "Packet type", base.HEX, packets),
    argument_type = ProtoField.uint8("p2os.argument_type", "Argument type", base.HEX, argument_types),
    argument = ProtoField.int32("p2os.argument", "Argument"),
    text = ProtoField.string("p2os.string", "String"),
    data = ProtoField.bytes("p2os.data", "Data"),
    checksum = ProtoField.uint16("p2os.checksum", "Checksum", base.HEX),
    bad = ProtoField.bool("p2os.bad", "Damaged"),
    x = of_sip(head.raw_x, "x", "XPOS (counts)"),
    y = of_sip(head.raw_y, "y", "YPOS (counts)"),
    heading = of_sip(head.raw_heading, "heading", "THPOS (4096 a turn)"),
    left = of_sip(head.raw_left_velocity, "left", "Left wheel (mm/s)"),
    right = of_sip(head.raw_right_velocity, "right", "Right wheel (mm/s)"),
    battery = of_sip(head.raw_battery, "battery", "Battery (0.1 V)"),
    stall_left = ProtoField.bool("p2os.sip.stall_left", "Left wheel stalled", 8, nil, 1),
    stall_right = ProtoField.bool("p2os.sip.stall_right", "Right wheel stalled", 8, nil, 1),
    rear_bumpers = ProtoField.uint8("p2os.sip.rear_bumpers", "Rear bumpers", base.HEX, nil, 0xFE),
    front_bumpers = ProtoField.uint8("p2os.sip.front_bumpers", "Front bumpers", base.HEX, nil, 0xFE),
    control = of_sip(head.raw_control, "control", "CONTROL (4096 a turn)"),
    flags = of_sip(head.raw_flags, "flags", "FLAGS, or servo 1 on P2OS", base.HEX),
    compass = of_sip(head.raw_compass, "compass", "Compass (2 deg)"),
    analog_port = of_sip(behind.first, "analog_port", "Analog port (P2OS; gripper on AROS and ARCOS)"),
    gripper = of_sip(behind.second, "gripper", "Gripper (P2OS; analog port on AROS and ARCOS)", base.HEX),
    analog = of_sip(behind.raw_analog, "analog", "Analog input"),
    digital_in = of_sip(behind.digital_in, "digital_in", "Digital inputs", base.HEX),
    digital_out = of_sip(behind.digital_out, "digital_out", "Digital outputs", base.HEX),
    sonar = ProtoField.string("p2os.sip.sonar", "Sonar (number: counts)"),
}
for _, row in ipairs(tail) do
    field["tail_" .. row[1]] = ProtoField[(row[3] and "int" or "uint") .. 8 * row[2]]("p2os.sip." .. row[1], row[4])
end
p2os.fields = field
local damaged = ProtoExpert.new("p2os.damaged", "Damaged frame", expert.group.CHECKSUM, expert.severity.ERROR)
p2os.experts = { damaged }

-- Sum of big-endian pairs from the command to the last argument; an odd last byte is XORed in.
local function checksum(buffer, first, last)
    local sum, place = 0, first
    while place < last do
        sum = (sum + buffer(place, 2):uint()) % 0x10000
        place = place + 2
    end
    if place == last then
        local byte, low = buffer(place, 1):uint(), sum % 0x100
        sum = sum - low + bit.bxor(low, byte)
    end
    return sum
end

local function add_sip(buffer, tree)
    if buffer:len() < wire.sip_bytes then return "" end
    local function at(row, past) return buffer(row.place + (past or 0), row.bytes) end
    for _, shown in ipairs({ { "x", head.raw_x }, { "y", head.raw_y }, { "heading", head.raw_heading },
        { "left", head.raw_left_velocity }, { "right", head.raw_right_velocity }, { "battery", head.raw_battery },
        { "stall_left", head.left }, { "stall_right", head.right }, { "rear_bumpers", head.left },
        { "front_bumpers", head.right }, { "control", head.raw_control }, { "flags", head.raw_flags },
        { "compass", head.raw_compass } }) do
        tree:add_le(field[shown[1]], at(shown[2]))
    end
    local readings, count = {}, at(head.count):uint()
    for number = 0, count - 1 do
        local place = wire.sonar_at + wire.reading_bytes * number
        if place + wire.reading_bytes > buffer:len() then break end
        readings[#readings + 1] = buffer(place, 1):uint() .. ": " .. buffer(place + 1, 2):le_uint()
    end
    if #readings > 0 then
        tree:add(field.sonar, buffer(wire.sonar_at, wire.reading_bytes * #readings), table.concat(readings, ", "))
    end
    local past = wire.reading_bytes * count
    local place = wire.sip_bytes + past
    if place <= buffer:len() then
        for _, shown in ipairs({ { "analog_port", behind.first }, { "gripper", behind.second },
            { "analog", behind.raw_analog }, { "digital_in", behind.digital_in },
            { "digital_out", behind.digital_out } }) do
            tree:add_le(field[shown[1]], at(shown[2], past))
        end
        for _, row in ipairs(tail) do
            if place + row[2] > buffer:len() then break end
            tree:add_le(field["tail_" .. row[1]], buffer(place, row[2]))
            place = place + row[2]
        end
    end
    return string.format(" x %d, y %d, heading %.1f deg, wheels %d %d mm/s", at(head.raw_x):le_uint() % wire.positions,
        at(head.raw_y):le_uint() % wire.positions, at(head.raw_heading):le_int() * 360 / 4096,
        at(head.raw_left_velocity):le_int(), at(head.raw_right_velocity):le_int())
end

local function add_command(buffer, tree)
    if buffer:len() < 2 then return "" end
    local kind = buffer(1, 1):uint()
    tree:add(field.argument_type, buffer(1, 1))
    if (kind == wire.positive or kind == wire.negative) and buffer:len() >= 4 then
        local value = buffer(2, 2):le_uint()
        if kind == wire.negative then value = -value end
        tree:add(field.argument, buffer(2, 2), value)
        return " " .. value
    elseif kind == wire.string and buffer:len() >= 3 then
        local length = math.min(buffer(2, 1):uint(), buffer:len() - 3)
        if length > 0 then tree:add(field.text, buffer(3, length)) end
        return " (" .. length .. " bytes)"
    elseif buffer:len() > 2 then
        tree:add(field.data, buffer(2))
    end
    return ""
end

-- One whole frame, or bytes that are none. Returns what to say in the list.
local function dissect_frame(buffer, tree, direction)
    local size = buffer:len()
    local branch = tree:add(p2os, buffer())
    branch:add(field.direction, direction):set_generated()
    local is_frame = size >= 6 and buffer(0, 2):uint() == wire.header and buffer(2, 1):uint() + 3 == size
    if is_frame and checksum(buffer, 3, size - 3) ~= buffer(size - 2, 2):uint() then is_frame = false end
    branch:add(field.bad, not is_frame):set_generated()
    if not is_frame then
        branch:add(field.data, buffer())
        branch:add_proto_expert_info(damaged)
        branch:append_text(", damaged")
        return "damaged: " .. tostring(buffer(0, math.min(size, 16)):bytes())
    end
    branch:add(field.count, buffer(2, 1))
    local kind, inside = buffer(3, 1):uint(), buffer(3, size - 5)
    local name, detail
    if direction == 1 then
        name = packets[kind] or string.format("packet 0x%02X", kind)
        branch:add(field.packet, buffer(3, 1))
        if kind >= wire.sip_first and kind <= wire.sip_last then
            detail = add_sip(inside:tvb(), branch)
        else
            detail = ""
            if size > 6 then branch:add(field.data, buffer(4, size - 6)) end
        end
    else
        name = (size == 6 and bare[kind]) or commands[kind] or ("command " .. kind)
        branch:add(field.command, buffer(3, 1))
        detail = add_command(inside:tvb(), branch)
    end
    branch:add(field.checksum, buffer(size - 2, 2))
    branch:append_text(", " .. name)
    return name .. detail
end

-- Whether bytes begin like a frame; where all of it is there, with its checksum.
local function is_frame(buffer)
    local size = buffer:len()
    if size < 6 or buffer(0, 2):uint() ~= wire.header then return false end
    local count = buffer(2, 1):uint()
    if count < wire.min_count or count > wire.max_count then return false end
    if count + 3 > size then return true end
    return checksum(buffer, 3, count) == buffer(count + 1, 2):uint()
end

-- What only a robot sends: a SIP, or an identity with its name.
local function is_robots(buffer)
    local kind, size = buffer(3, 1):uint(), buffer(2, 1):uint() - 2
    return (kind >= wire.sip_first and kind <= wire.sip_last and size >= wire.sip_bytes)
        or (kind == wire.identity and size > 3)
end

-- Number of a TCP conversation -> address and port of its client; the first frame decides.
local clients = {}
local stream_number = Field.new("tcp.stream")

function p2os.init()
    clients = {}
end

local function dissect_stream(buffer, pinfo, tree)
    local number = stream_number().value
    local source, target = pinfo.src_port .. tostring(pinfo.src), pinfo.dst_port .. tostring(pinfo.dst)
    if clients[number] == nil and is_frame(buffer) then
        clients[number] = is_robots(buffer) and target or source
    end
    pinfo.cols.protocol = "P2OS"
    local direction = (clients[number] or source) == source and 0 or 1
    local said, place, size = {}, 0, buffer:len()
    while place < size do
        local left = size - place
        if buffer(place, 1):uint() ~= 0xFA then
            local first = place
            while place < size and buffer(place, 1):uint() ~= 0xFA do place = place + 1 end
            said[#said + 1] = dissect_frame(buffer(first, place - first):tvb(), tree, direction)
        else
            local wanted = left < 3 and 3 or (buffer(place + 1, 1):uint() == 0xFB and buffer(place + 2, 1):uint() + 3 or 1)
            if wanted > left then
                pinfo.desegment_offset = place
                pinfo.desegment_len = left < 3 and DESEGMENT_ONE_MORE_SEGMENT or wanted - left
                break
            end
            said[#said + 1] = dissect_frame(buffer(place, wanted):tvb(), tree, direction)
            place = place + wanted
        end
    end
    pinfo.cols.info = table.concat(said, " | ")
    return size
end

function p2os.dissector(buffer, pinfo, tree)
    if pinfo.src_port > 0 then return dissect_stream(buffer, pinfo, tree) end
    pinfo.cols.protocol = "P2OS"
    local direction = buffer(0, 1):uint()
    pinfo.cols.src = direction == 0 and "client" or "robot"
    pinfo.cols.dst = direction == 0 and "robot" or "client"
    pinfo.cols.info = dissect_frame(buffer(1):tvb(), tree, direction)
end

-- Over TCP the frames are found again in the stream; a frame that is not whole yet waits for more.
DissectorTable.get("wtap_encap"):add(wtap.USER0, p2os)
-- The port of simulated Pioneers; on others Wireshark asks what registered the port first ("Decode As...", or
-- the preference tcp.try_heuristic_first, where that takes the stream).
DissectorTable.get("tcp.port"):add(8101, p2os)
p2os:register_heuristic("tcp", function(buffer, pinfo, tree)
    if not is_frame(buffer) then return false end
    pinfo.conversation = p2os
    dissect_stream(buffer, pinfo, tree)
    return true
end)
