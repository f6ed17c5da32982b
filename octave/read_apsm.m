function m = read_apsm(folder)
% m = read_apsm('model'): a model folder of apsm, in Octave (7 or later) or MATLAB.
%   m.mean       J x 3
%   m.modes      J x 3 x K, orthonormal
%   m.variances  K x 1
%   m.names      I names, m.scores I x K: particles(:,:,i) = mean + sum_k scores(i,k) modes(:,:,k)
%   m.particles  J x 3 x I, world frame
%   m.certified  I x 1
%   m.part       J names of parts, of a joint; else empty
model = jsondecode(fileread(fullfile(folder, 'model.json')));
certificate = jsondecode(fileread(fullfile(folder, 'certificate.json')));
m.mean = model.mean;
m.variances = model.variances(:);
J = size(m.mean, 1);
K = numel(m.variances);
m.modes = permute(reshape(model.modes, [K, J, 3]), [2, 3, 1]);
lines = strsplit(strtrim(fileread(fullfile(folder, 'scores.csv'))), sprintf('\n'));
I = numel(lines) - 1;
m.names = cell(I, 1);
m.scores = zeros(I, K);
m.particles = zeros(J, 3, I);
endings = {''};
m.part = {};
if isfield(model, 'parts')
  endings = strcat('_', {model.parts.name});
  for d = 1:numel(model.parts)
    m.part = [m.part; repmat({model.parts(d).name}, model.parts(d).particles, 1)];
  end
end
for i = 1:I
  [m.names{i}, rest] = first_field(lines{i + 1});
  m.scores(i, :) = sscanf(rest, '%f,')';
  sets = cellfun(@(e) load('-ascii', fullfile(folder, 'particles', [m.names{i} e '_world.particles'])), endings(:), ...
                 'UniformOutput', false);
  m.particles(:, :, i) = vertcat(sets{:});
end
m.certified = false(I, 1);
for i = 1:I
  shape = certificate.per_shape;
  if iscell(shape), one = shape{i}; else, one = shape(i); end
  m.certified(i) = strcmp(one.verdict, 'certified');
end
end

function [name, rest] = first_field(line)
% A name in quotes may hold commas, and quotes twice.
if line(1) ~= '"'
  comma = find(line == ',', 1);
  name = line(1:comma - 1);
else
  k = 2;
  while line(k) ~= '"' || (k < numel(line) && line(k + 1) == '"')
    k = k + 1 + (line(k) == '"');
  end
  name = strrep(line(2:k - 1), '""', '"');
  comma = k + 1;
end
rest = line(comma + 1:end);
end
