-- Wireshark takes all fields of a protocol at once, as one list.
local PROTO_FIELDS = {}
for _, message in pairs(MESSAGES) do
    for _, field in ipairs(message.fields) do PROTO_FIELDS[#PROTO_FIELDS + 1] = field.proto end
end
network.fields = PROTO_FIELDS

-- What is the same for every network: raw values out of the bytes, numbers out of raw values, items in the tree.
-- A raw value is kept in two halves of 32 bits, as a number of Lua 5.2 holds 53 bits.

local HALF = 2 ^ 32

local function taken(data, chunks)
    local low, high = 0, 0
    for _, chunk in ipairs(chunks) do
        local byte, bit, shift, bits = chunk[1], chunk[2], chunk[3], chunk[4]
        local part = math.floor(data(byte, 1):uint() / 2 ^ bit) % 2 ^ bits
        if shift < 32 then
            low = low + part * 2 ^ shift
        else
            high = high + part * 2 ^ (shift - 32)
        end
    end
    return low % HALF, high + math.floor(low / HALF)
end

local function real(negative, exponent, fraction, bits, bias)
    local value
    if exponent == 2 * bias + 1 then
        value = fraction == 0 and math.huge or 0 / 0
    elseif exponent == 0 then
        value = fraction / 2 ^ bits * 2 ^ (1 - bias)
    else
        value = (1 + fraction / 2 ^ bits) * 2 ^ (exponent - bias)
    end
    return negative and -value or value
end

local function number(low, high)
    return high * HALF + low
end

-- The number that a raw value means (rounded if it has more than 53 bits), and the same as the tree takes it.
local NUMERALS = {
    unsigned = function(low, high, width)
        local value = number(low, high)
        return value, width > 32 and UInt64.new(low, high) or value
    end,
    signed = function(low, high, width)
        local value = number(low, high)
        if value < 2 ^ (width - 1) then
            return value, width > 32 and Int64.new(low, high) or value
        end
        if width > 32 then
            return value - 2 ^ width, Int64.new(low, high + HALF - 2 ^ (width - 32))
        end
        return value - 2 ^ width, value - 2 ^ width
    end,
    real = function(low, high, width)
        local value
        if width == 32 then
            value = real(low >= 2 ^ 31, math.floor(low / 2 ^ 23) % 2 ^ 8, low % 2 ^ 23, 23, 127)
        else
            value = real(high >= 2 ^ 31, math.floor(high / 2 ^ 20) % 2 ^ 11, number(low, high % 2 ^ 20), 52, 1023)
        end
        return value, value
    end,
}

-- Adds one field to the tree and returns its name and value as words.
local function show(tree, data, field, is_left_out)
    local low, high
    if is_left_out then
        low, high = field.default[1], field.default[2]
    else
        low, high = taken(data, field.chunks)
    end
    local value, shown = NUMERALS[field.numeral](low, high, field.width)
    local item
    if is_left_out then
        item = tree:add(field.proto, shown):set_generated()
    else
        item = tree:add(field.proto, data(field.first, field.bytes), shown)
    end
    local word = field.names[value]
    if word then
        return field.name .. "=" .. word
    end
    local after = field.unit ~= "" and " " .. field.unit or ""
    if field.low and (value < field.low or value > field.high) then
        after = after .. " (out of range)"
    end
    item:append_text(after)
    return field.name .. "=" .. tostring(shown) .. after
end

local wrong_length = ProtoExpert.new(SHORT_NAME .. ".length", "Length of the frame", expert.group.MALFORMED,
    expert.severity.WARN)
network.experts = { wrong_length }

local identifier, is_remote = Field.new("can.id"), Field.new("can.flags.rtr")

-- What the dissector returns for a frame of ours, even without data: after 0 the next dissector would try it.
local TAKEN = 8

function network.dissector(data, packet, root)
    local message = MESSAGES[identifier().value]
    if not message or is_remote().value then
        return 0
    end
    packet.cols.protocol = SHORT_NAME
    packet.cols.info = message.name
    local tree = root:add(network, data(), message.name)
    tree:append_text(" (" .. message.path .. ")")
    local length = data:len()
    local is_cut = length < message.length
    if is_cut and length ~= message.shortest then
        tree:add_proto_expert_info(wrong_length, length .. " bytes, expected " .. message.expected)
        packet.cols.info:append(" [" .. length .. " bytes, expected " .. message.expected .. "]")
        return TAKEN
    end
    for _, field in ipairs(message.fields) do
        local words = show(tree, data, field, is_cut and field.default ~= nil)
        packet.cols.info:append(" " .. words)
    end
    return TAKEN
end

for id in pairs(MESSAGES) do
    DissectorTable.get("can.id"):add(id, network)
end
